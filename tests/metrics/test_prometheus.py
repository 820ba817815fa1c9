"""What Prometheus makes of a demo: the metrics, every panel of the dashboard, the alerts."""

import json
import re
import subprocess
from pathlib import Path

import pytest
from metrics.conftest import Prometheus, fetched, program

DOCS = Path(__file__).parents[2] / "docs"
DASHBOARD = json.loads((DOCS / "grafana.json").read_text())
EXPRESSIONS = sorted(
    {target["expr"] for panel in DASHBOARD["panels"] for target in panel["targets"]}
)
ALERTS = re.findall(r"alert: (\w+)", (DOCS / "alerts.yml").read_text())


def promtool(*arguments: object, told: bytes | None = None) -> str:
    done = subprocess.run(
        [program("promtool"), *map(str, arguments)], input=told, capture_output=True, check=False
    )
    said = (done.stdout + done.stderr).decode()
    assert done.returncode == 0, said
    return said


def test_the_metrics_are_as_prometheus_wants_them(demo: str, lit_rig: str) -> None:
    for target in (demo, lit_rig):
        assert promtool("check", "metrics", told=fetched(f"http://{target}/metrics")) == ""


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_every_panel_of_the_dashboard_shows_something(
    expression: str, prometheus: Prometheus
) -> None:
    asked = expression.replace("$__rate_interval", "1m").replace("$instance", ".*")
    assert "$" not in asked
    assert prometheus.query(asked), expression


def test_the_dashboard_shows_what_is_true(prometheus: Prometheus, demo: str) -> None:
    (sent,) = prometheus.query(f'rate(cornertouchd_tuio_packets_total{{instance="{demo}"}}[1m])')
    assert float(sent["value"][1]) > 0.0
    live = prometheus.query(f'sum(cornertouchd_camera_live{{instance="{demo}"}})')
    assert live[0]["value"][1] == "4"


def test_the_alerts_are_rules_and_fire_when_they_should() -> None:
    assert "SUCCESS" in promtool("check", "rules", DOCS / "alerts.yml")
    assert "SUCCESS" in promtool("test", "rules", Path(__file__).parent / "alerts_test.yml")


def test_prometheus_evaluates_all_alerts(prometheus: Prometheus) -> None:
    rules = prometheus.rules()
    assert sorted(rules) == sorted(ALERTS)
    assert "err" not in rules.values()


def test_the_page_of_docs_explains_every_metric(demo: str, lit_rig: str) -> None:
    page = (DOCS / "metrics.md").read_text()
    for target in (demo, lit_rig):
        told = fetched(f"http://{target}/metrics").decode()
        names = set(re.findall(r"^# HELP (\w+) ", told, re.MULTILINE))
        unknown = {name for name in names if f"`{name}" not in page}
        assert {name for name in unknown if not name.endswith("_created")} == set()
