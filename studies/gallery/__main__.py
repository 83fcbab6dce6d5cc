"""`python -m studies.gallery`."""

from studies.gallery.page import write

if __name__ == "__main__":
    write()
