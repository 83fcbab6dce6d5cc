"""Solutions in files, tables and pictures."""

import json

import meshio
import numpy as np
import pytest

import anctmm as at
from anctmm.errors import OutputError, ResultError

ROD, RUBBER = at.Circle(0.02), at.Material(E=5e6, density=1100.0)


def fork(angle=None, force=(0.0, -0.5)):
    trunk = at.Beam("trunk", (0, 0), (0, 0.3), ROD, RUBBER)
    twig = at.Beam("twig", (0, 0.3), (0.2, 0.5), ROD, RUBBER)
    joints = [at.Clamp("trunk.start", angle=angle), at.Weld("trunk.end", "twig.start")]
    return at.Scene("fork", [trunk, twig], joints, [at.Force("twig.end", force)], gravity=(0, -9.81))


@pytest.fixture(scope="module")
def run():
    return at.Discretisation(mesh=2, dt=2e-3, t_end=0.1, output_dt=0.01)


@pytest.fixture(scope="module")
def moved(run):
    return at.solve(fork(at.Quintic(turn=1.0, duration=0.1)), run)


def arrays_of(solution):
    yield from [solution.t, *vars(solution.energy).values()]
    for field in solution.fields.values():
        yield from (x for x in vars(field).values() if isinstance(x, np.ndarray))


def assert_same(one, two):
    """Every bit."""
    pairs = list(zip(arrays_of(one), arrays_of(two), strict=True))
    assert len(pairs) > 6
    for a, b in pairs:
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    for name in ("solver", "scene", "run", "status", "dofs", "static"):
        assert getattr(one, name) == getattr(two, name)
    assert repr(one.cost) == repr(two.cost)  # NaN is not equal to itself


def test_every_bit_comes_back(moved, tmp_path):
    path = moved.save(tmp_path / "history")
    assert path == tmp_path / "history.npz"
    back = at.load(path)
    assert_same(moved, back)
    np.testing.assert_array_equal(back.velocity("twig", 0.3), moved.velocity("twig", 0.3))
    assert list(tmp_path.iterdir()) == [path]
    rest = at.solve_static(fork(), mesh=2)
    assert_same(rest, at.load(rest.save(tmp_path / "rest")))


def test_functions_come_from_the_scene_of_the_caller(run, tmp_path):
    scene = fork(angle=lambda t: (t**2, 2.0 * t, 2.0))
    found = at.solve(scene, run)
    path = found.save(tmp_path / "driven")
    joint = scene.joints[0]
    np.testing.assert_array_equal(at.load(path, scene).reaction(joint), found.reaction(joint))
    alone = at.load(path)
    np.testing.assert_array_equal(alone.angle("twig.end"), found.angle("twig.end"))
    with pytest.raises(ResultError, match=r"lambda.*was not saved with the solution"):
        alone.scene.joints[0].angle(0.0)
    with pytest.raises(ResultError, match="is of scene 'fork', not of the one given"):
        at.load(path, fork(scene.joints[0].angle, force=(1.0, 0.0)))


def test_files_that_are_not_ours_or_damaged_are_refused(moved, tmp_path):
    with pytest.raises(ResultError, match=r"no saved solution.*FileNotFoundError"):
        at.load(tmp_path / "none.npz")
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    with pytest.raises(ResultError, match="'about'"):
        at.load(other)
    np.savez(other, about=np.array(json.dumps({"format": "anctmm solution 9"})))
    with pytest.raises(ResultError, match="'anctmm solution 9'; 'anctmm solution 2' is needed"):
        at.load(other)
    about = np.array(json.dumps({"format": "anctmm solution 2"}))
    for tree, words in ((json.dumps({"list": 1}), "no saved solution"), ("[]", "holds a list")):
        np.savez(other, about=about, description=tree)
        with pytest.raises(ResultError, match=words):
            at.load(other)
    whole = moved.save(tmp_path / "whole").read_bytes()
    cut = tmp_path / "cut.npz"
    for length in (len(whole) // 2, len(whole) - 30):
        cut.write_bytes(whole[:length])
        with pytest.raises(ResultError, match="no saved solution"):
            at.load(cut)


def test_a_folder_that_cannot_be_written_is_named(moved, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        moved.save(blocked / "x.npz")
    with pytest.raises(OutputError, match="cannot be written to"):
        moved.to_vtk(blocked / "x")


def test_a_table_of_places(moved):
    table = moved.to_frame(["twig.end", ("trunk", 0.5)])
    assert table.index.name == "t (s)"
    np.testing.assert_array_equal(table["twig.end y (m)"], moved.position("twig.end")[:, 1])
    np.testing.assert_array_equal(table["trunk 0.5 vx (m/s)"], moved.velocity("trunk", 0.5)[:, 0])
    np.testing.assert_array_equal(table["twig.end angle (rad)"], moved.angle("twig.end"))
    np.testing.assert_array_equal(table["work (J)"], moved.energy.work)
    with pytest.raises(ResultError, match="a list of places is needed"):
        moved.to_frame("twig.end")


def test_a_data_set_survives_netcdf(moved, tmp_path):
    xarray = pytest.importorskip("xarray")
    found = moved.to_dataset(points=5)
    assert found["position"].dims == ("t", "body", "fraction", "axis")
    np.testing.assert_array_equal(
        found["velocity"].sel(body="twig", fraction=0.5).values, moved.velocity("twig", 0.5)
    )
    assert found["angle"].attrs["units"] == "rad"
    found.to_netcdf(tmp_path / "x.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "x.nc", engine="h5netcdf") as back:
        xarray.testing.assert_identical(back.load(), found)
    with pytest.raises(ResultError, match="points is 1"):
        moved.to_dataset(1)


def plate_and_mass(*more):
    plate = at.RigidBody(
        "plate", 1.0, 0.1, (0.4, 0), points={"a": (0.3, 0), "b": (0.5, -0.1), "c": (0.5, 0.1)}
    )
    mass = at.PointMass("mass", 1.0, (0.0, 1.0))
    return at.Scene("plate", [plate, *more, mass], [at.Pin("plate.a")], gravity=(0, -9.81))


def test_files_of_vtk_show_bodies_of_all_kinds(tmp_path):
    run = at.Discretisation(mesh=1, dt=5e-3, t_end=0.01)
    beam = at.Beam("beam", (0, 0), (0.2, 0), ROD, RUBBER)
    found = at.solve(plate_and_mass(beam), run)
    found.to_vtk(tmp_path, points=3)
    read = meshio.read(tmp_path / "plate_00002.vtu")
    assert sum(len(cells.data) for cells in read.cells) == 2 + 3 + 1
    fields, around = list(found.fields), ["plate.b", "plate.c", "plate.a", "plate.b"]
    places = {"beam": [("beam", 0.0), ("beam", 0.5), ("beam", 1.0)], "plate": around, "mass": ["mass.center"]}
    for values, of in ((read.points, found.position), (read.point_data["velocity"], found.velocity)):
        wanted = [of(place)[2] for name in fields for place in places[name]]
        np.testing.assert_array_equal(values[:, :2], wanted)
    alone = at.solve(plate_and_mass(), run)
    assert "<DataSet" in alone.to_vtk(tmp_path / "alone").read_text()
    with pytest.raises(ResultError, match="no outputs to write"):
        alone.until(0, alone.status).to_vtk(tmp_path)


def test_pictures(moved, tmp_path):
    figure = moved.plot(times=[0.0, 0.05, 0.1])
    left, right = figure.axes
    assert right.get_ylabel() == "energy (J)"
    assert len(left.lines) == 3 * 2 + 1  # and the clamp
    figure.savefig(tmp_path / "plot.png")
    page = moved.animate(tmp_path / "motion.html")
    assert "<script" in page.read_text()
    from PIL import Image

    with Image.open(moved.animate(tmp_path / "motion.gif")) as picture:
        assert picture.n_frames == len(moved.t)
    with pytest.raises(ResultError, match=r"'x.mp4'"):
        moved.animate("x.mp4")
    with pytest.raises(ResultError, match="fps is 0"):
        moved.animate("x.gif", fps=0)
