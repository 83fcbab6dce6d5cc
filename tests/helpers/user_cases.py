"""Files of cases as users write them: nothing in the program was tuned for their scenes."""

from pathlib import Path

FOLDER = Path(__file__).parent / "cases"
ARM, DOUBLE_PENDULUM, PORTAL_FRAME, THROWN_CHAIN, THREE_SUPPORTS = (
    str(FOLDER / f"{name}.py")
    for name in ("arm", "double_pendulum", "portal_frame", "thrown_chain", "three_supports")
)
#: One with bodies of all kinds, springs and a guide: what pictures have to show.
SLIDER_CRANK = str(FOLDER / "slider_crank.py")
FILES = (DOUBLE_PENDULUM, PORTAL_FRAME, THROWN_CHAIN, THREE_SUPPORTS)
