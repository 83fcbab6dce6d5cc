"""Pictures and animations of mechanisms: everything that moves is to be seen."""

from dataclasses import replace

import numpy as np
import pytest
from browser import Tab, needs_chromium
from user_cases import SLIDER_CRANK

import anctmm as at
from anctmm.results.export.shapes import shapes_of, supports_of
from studies.cases import cases_in


@pytest.fixture(scope="module")
def mechanism():
    """Bodies, joints and springs of all kinds: what stands at a few outputs is enough, and needs no solver."""
    (case,) = cases_in(SLIDER_CRANK)
    turn = at.RotationalSpring("rod.end", "plate.a", stiffness=0.1)
    scene = replace(case.scene, connectors=(*case.scene.connectors, turn))
    return at.solve(scene, mesh=2, dt=2e-3, t_end=0.02, output_dt=2e-3)


@pytest.mark.parametrize("times", ["x", [], [[0.0]], [float("nan")]])
def test_times_that_are_none_are_refused(times):
    scene = at.Scene("mass", [at.PointMass("m", 1.0, (0.0, 0.0))], gravity=(0.0, -9.81))
    found = at.solve(scene, dt=1e-2, t_end=0.1, output_dt=0.05)
    assert len(found.plot(0.05).axes) == 2
    with pytest.raises(at.errors.ResultError, match="finite numbers are needed"):
        found.plot(times)


def test_everything_that_moves_has_a_shape(mechanism):
    found = shapes_of(mechanism)
    assert [(s.name, s.kind) for s in found] == [
        ("crank", "beam"), ("rod", "beam"), ("plate", "rigid"), ("load", "mass"), ("", "spring"), ("", "spring"),
        ("", "rotational spring"), ("", "guide"),
    ]  # fmt: skip
    plate, load, first, second = (found[k].points for k in (2, 3, 4, 5))
    corners = [mechanism.position(f"plate.{key}") for key in "abc"]
    assert all(np.abs(plate - corner[:, None]).sum(axis=2).min(axis=1).max() < 1e-14 for corner in corners)
    assert (plate[:, 0] == plate[:, -1]).all()  # closed
    np.testing.assert_array_equal(load[:, 0], mechanism.position("load.center"))
    ends = [mechanism.position("load.center"), mechanism.position("plate.c")]
    np.testing.assert_allclose(first[:, [0, -1]], np.stack(ends, axis=1), atol=1e-14)
    np.testing.assert_array_equal(second[:, -1], np.full((11, 2), (1.2, 0.05)))
    assert set(supports_of(mechanism.scene)) == {("clamp", (0.0, 0.0)), ("pin", (1.2, 0.05))}


def test_pictures_of_mechanisms(mechanism, tmp_path):
    figure = mechanism.plot()
    axes = figure.axes[0]
    assert {text.get_text() for text in axes.texts} == {"crank", "rod", "plate", "load"}
    figure.savefig(tmp_path / "mechanism.png")
    low, high = axes.get_xlim()
    assert low < 0.0
    assert high > 1.2  # where a spring is fixed


@needs_chromium
@pytest.mark.parametrize("width", [1280, 390])
def test_the_player_of_an_animation_plays(mechanism, browser, width, tmp_path):
    """The page that `animate` writes, offline."""
    tab = Tab(browser, mechanism.animate(tmp_path / "motion.html"), width=width)
    image = "return document.querySelector('.animation img').src"
    tab.run("document.querySelector('button[title=\"First frame\"]').click();")
    first = tab.run(image)
    tab.run("document.querySelector('button[title=\"Next frame\"]').click();")
    assert first.startswith("data:image/png")
    assert tab.run(image) != first
    assert tab.run("return document.documentElement.scrollWidth") == width
    signs = tab.run(
        "return [...document.querySelectorAll('.anim-buttons button')].map(b => b.textContent.trim());"
    )
    assert "▶" in signs
    assert all(signs)
    assert tab.wrong == []
    tab.close()
