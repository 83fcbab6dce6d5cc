"""Pictures and animations of mechanisms: everything that moves is to be seen, and no name lies on another."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from browser import Tab, needs_chromium
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from user_cases import SLIDER_CRANK

import anctmm as at
from anctmm.results.export import pictures
from anctmm.results.export.background import draw_background
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
        ("", "spring"), ("", "guide"),
    ]  # fmt: skip
    plate, load, first, second = (found[k].points for k in (2, 3, 4, 5))
    corners = [mechanism.position(f"plate.{key}") for key in "abc"]
    assert all(np.abs(plate - corner[:, None]).sum(axis=2).min(axis=1).max() < 1e-14 for corner in corners)
    assert (plate[:, 0] == plate[:, -1]).all()  # closed
    np.testing.assert_array_equal(load[:, 0], mechanism.position("load.center"))
    ends = [mechanism.position("load.center"), mechanism.position("plate.c")]
    np.testing.assert_allclose(first[:, [0, -1]], np.stack(ends, axis=1), atol=1e-14)
    np.testing.assert_array_equal(second[:, -1], np.full((11, 2), (1.2, 0.05)))
    assert {(s.kind, s.position) for s in supports_of(mechanism.scene)} == {
        ("clamp", (0.0, 0.0)), ("pin", (1.2, 0.05)),
    }  # fmt: skip


def test_a_guide_moves_with_the_body_that_carries_it():
    """The line of a slider on a plate that turns freely turns as the plate does."""
    plate = at.RigidBody("plate", 1.0, 0.1, (0.0, 0.0), {"a": (1.0, 0.0)}, spin=2.0)
    bead = at.PointMass("bead", 0.1, (1.0, 0.0), velocity=(0.0, 2.0))
    scene = at.Scene(
        "s", [plate, bead], [at.Pin("plate.center"), at.Slider("bead.center", (1.0, 0.0), body="plate")]
    )
    solution = at.solve(scene, dt=1e-2, t_end=0.2, output_dt=0.1)
    line = shapes_of(solution)[-1].points
    along = line[:, 1] - line[:, 0]
    angle = np.arctan2(along[:, 1], along[:, 0])
    np.testing.assert_allclose(angle, solution.angle("plate.center"), atol=1e-12)
    assert angle[-1] > 0.3


def test_a_body_whose_points_are_its_centre_is_seen():
    """As of pistons; an outline through one place has no length."""
    bodies = [
        at.RigidBody("piston", 1.0, 0.1, (0.5, 0.2), {"pin": (0.5, 0.2), "ring": (0.5, 0.2)}),
        at.RigidBody("crank", 1.0, 0.1, (0.0, 0.0), {"pin": (0.5, 0.2)}),
    ]
    solution = at.solve(at.Scene("s", bodies), dt=1e-2, t_end=0.02, output_dt=1e-2)
    piston, crank = shapes_of(solution)
    assert (piston.kind, crank.kind) == ("mass", "rigid")
    assert piston.points.shape == (3, 1, 2)
    assert np.ptp(crank.points[:, :, 0]) == pytest.approx(0.5)


def test_names_are_no_formulas(tmp_path):
    """Between dollar signs they were, or ended the run; a name that begins with _ was left out of legends."""
    names = [r"$\foo$", "_x$", "cart"]
    masses = [at.PointMass(name, 1.0, (float(k), 0.0)) for k, name in enumerate(names)]
    solution = at.solve(at.Scene(r"5 $\foo{$", masses), dt=1e-2, t_end=0.02, output_dt=1e-2)
    figure = solution.plot()
    FigureCanvasAgg(figure).draw()
    shown = [text.get_text().replace(r"\$", "$") for text in figure.axes[0].texts]
    assert [name for name in names if name not in shown] == []
    drawing = pictures._Drawing(figure.subplots(), solution)
    legend = drawing.axes.get_legend()
    assert [text.get_text().replace(r"\$", "$") for text in legend.get_texts()] == names
    solution.animate(tmp_path / "motion.html")
    at.modes(
        at.Scene(
            r"5 $\foo{$",
            [at.Beam("b", (0, 0), (1, 0), at.Circle(0.01), at.Material(1e9, 1e3))],
            [at.Clamp("b.start")],
        ),
        mesh=2,
        count=1,
    ).plot().savefig(tmp_path / "modes.png")


def test_pictures_of_mechanisms(mechanism, tmp_path):
    figure = mechanism.plot()
    axes = figure.axes[0]
    assert {text.get_text() for text in axes.texts} == {"crank", "rod", "plate", "load"}
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in axes.texts]
    assert not any(a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    low, high = axes.get_xlim()
    assert low < 0.0
    assert high > 1.2  # where a spring is fixed
    with Image.open(mechanism.animate(tmp_path / "motion.gif")) as picture:
        assert picture.n_frames == len(mechanism.t)


def test_frames_show_what_drawing_all_anew_shows(mechanism):
    """Axes, legend and supports are one picture; they moved by some pixels after the first frame."""

    def drawn(k, anew):
        figure = Figure(layout="constrained")
        drawing = pictures._Drawing(figure.subplots(), mechanism)
        if not anew:
            draw_background(drawing.axes, [*drawing.move(0), drawing.axes.title])
        drawing.move(k)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return np.array(canvas.buffer_rgba(), dtype=int)

    for k in (0, len(mechanism.t) - 1):
        # lines of the grid are behind the filling of bodies, not before it
        assert np.abs(drawn(k, anew=False) - drawn(k, anew=True)).max() <= 16
    assert np.abs(drawn(0, anew=False) - drawn(len(mechanism.t) - 1, anew=False)).max() > 100


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


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 0.03, 1.0, 7e3, 1e5])
@pytest.mark.parametrize("t_end", [3e-7, 0.015, 40.0])
def test_numbers_at_the_axes_do_not_run_into_each_other(scale, t_end):
    mass = at.PointMass("m", mass=0.3, position=(0, 0), velocity=(scale / t_end, 0.5 * scale / t_end))
    found = at.solve(at.Scene("thrown", [mass]), dt=t_end / 4, t_end=t_end)
    figure = found.plot()
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    for axes in figure.axes:
        for axis, way in ((axes.xaxis, 0), (axes.yaxis, 1)):
            low, high = sorted(axis.get_view_interval())
            seen = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
            boxes = [tick.label1.get_window_extent(renderer) for tick in seen if tick.label1.get_text()]
            edges = sorted((box.min[way], box.max[way]) for box in boxes)
            assert len(edges) > 2
            assert all(left[1] + 2.0 < right[0] for left, right in pairwise(edges))
