"""`python -m cornertouchd.monitor`: started by the daemon."""

from cornertouchd.monitor.stepping_back import step_back

step_back()  # before the imports, which take a quarter of a second

from cornertouchd.monitor.process import main  # noqa: E402

main()
