"""`python -m studies` is `anctmm`."""

from studies.cli import main

if __name__ == "__main__":
    main()
