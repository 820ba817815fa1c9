"""`python -m cornertouchd`."""

from cornertouchd.cli import main

if __name__ == "__main__":
    main(prog_name="cornertouchd")
