"""What type checkers say of users' scripts: what runs is accepted as it is typed, and what does not is seen."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "tests" / "helpers" / "processes" / "typed_script.py"


def mypy(file: Path) -> tuple[int, str]:
    strictly = [
        "--strict",
        "--follow-imports=silent",
        "--no-error-summary",
    ]  # the user's file, not the package
    command = [sys.executable, "-m", "mypy", *strictly, str(file)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_what_users_write_is_accepted():
    assert mypy(SCRIPT) == (0, "")


WRONG = {
    "bodies": ('at.Scene("s", 5)', 'Argument 2 to "Scene"'),
    "a joint among the bodies": ('at.Scene("s", [at.Clamp("a.start")])', 'expected "BodyKind"'),
    "a body among the joints": (
        'at.Scene("s", [], [at.PointMass("m", 1.0, (0, 0))])',
        'expected "JointKind"',
    ),
    "a point of a text": ('at.PointMass("m", 1.0, position="here")', 'Argument "position"'),
    "breaks": ("at.History(lambda t: t, breaks=0.1)", 'Argument "breaks"'),
    "no function": ("at.History(1.0)", 'Argument 1 to "History"'),
    "probes": ('at.Case(at.Scene("s", []), probes=3, t_end=1.0)', 'Argument "probes"'),
    "a name that is not there": ('at.Scene("s", [], supports=[])', 'Unexpected keyword argument "supports"'),
}


def test_what_cannot_be_is_seen(tmp_path):
    lines = [line for line, _ in WRONG.values()]
    (tmp_path / "wrong.py").write_text("import anctmm as at\n\n" + "\n".join(lines) + "\n")
    code, said = mypy(tmp_path / "wrong.py")
    assert code == 1
    for number, (line, told) in enumerate(WRONG.values(), 3):
        assert any(f"wrong.py:{number}: " in m and told in m for m in said.splitlines()), (line, said)
