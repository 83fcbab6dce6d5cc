"""Nothing is read from a directory that another user could have filled."""

import os

import pytest

from anctmm.jit.files import cache_dir

pytestmark = pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners of files")


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The directory among temporary files, of a user whose own cache cannot be written; and what is said."""
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("ANCTMM_CACHE", str(tmp_path / "file"))
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    cache_dir._once.cache_clear()
    said = []
    monkeypatch.setattr(cache_dir, "note", said.append)
    yield tmp_path / f"anctmm-{os.getuid()}", said
    cache_dir._once.cache_clear()


def test_a_directory_among_temporary_files_is_made_for_its_owner_only(temporary):
    place, said = temporary
    old = os.umask(0)
    try:
        assert cache_dir.kept_in("runs") == place / "runs"
    finally:
        os.umask(old)
    assert place.stat().st_mode & 0o777 == 0o700
    assert cache_dir.kept_in("runs") == place / "runs"
    (text,) = said
    assert str(place) in text
    assert "is used instead" in text


def link(place):
    (place.parent / "elsewhere").mkdir(mode=0o700)
    place.symlink_to(place.parent / "elsewhere")


def dangling(place):
    place.symlink_to(place.parent / "nothing")


def opened(mode):
    def make(place):
        place.mkdir()
        place.chmod(mode)

    return make


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (link, "it is a link"),
        (dangling, "it is a link"),
        (lambda place: place.write_text(""), "it is no directory"),
        (opened(0o777), "open to other users, with mode 777"),
        (opened(0o750), "open to other users, with mode 750"),
        (opened(0o701), "open to other users, with mode 701"),
    ],
)
def test_a_directory_that_others_may_have_filled_is_not_used(temporary, make, reason):
    place, said = temporary
    make(place)
    assert cache_dir.kept_in("kernels") is None
    (text,) = said
    assert reason in text
    assert str(place) in text
    assert "compiled kernels are not stored" in text


def test_a_directory_of_another_user_is_not_used(temporary, monkeypatch):
    place, said = temporary
    place.mkdir(mode=0o700)
    user = os.getuid()
    monkeypatch.setattr("os.getuid", lambda: user + 1)
    place.rename(place.parent / f"anctmm-{user + 1}")
    assert cache_dir.kept_in("kernels") is None
    assert "belongs to another user" in said[0]
