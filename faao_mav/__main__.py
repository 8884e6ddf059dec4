"""`python -m faao_mav` is `faao-mission`."""

from faao_mav.cli.main import run

if __name__ == "__main__":
    run()
