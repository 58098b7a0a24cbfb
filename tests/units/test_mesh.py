import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from opl.errors import InputError
from opl.files.resources import folder
from opl.geometry.mesh import TriangleMesh, load_mesh
from opl.geometry.mesh_file import read_triangles
from tests.support.surfaces import load_surface, profile_distance

CORNERS = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 10.0]])
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def write(path, vertices=CORNERS, faces=TETRAHEDRON):
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return path


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj", ".STL"])
def test_every_format_gives_the_same_solid_in_metres(tmp_path, suffix):
    mesh = load_mesh(write(tmp_path / f"part{suffix}"), "mm")
    assert mesh.vertices.shape == (4, 3)
    assert mesh.faces.shape == (4, 3)
    assert mesh.volume == pytest.approx(30e-3 * 20e-3 * 10e-3 / 6.0)


@pytest.mark.parametrize("name", ["v_shape/v_shape.stl", "faucet/faucet.stl"])
def test_binary_stl_is_read_as_trimesh_reads_it(name):
    path = folder("workpieces") / name
    theirs = trimesh.load_mesh(path)
    corners, triangles = read_triangles(path)
    assert np.array_equal(corners, theirs.vertices)
    assert np.array_equal(triangles, theirs.faces)


def test_text_that_calls_itself_stl_is_read_too(tmp_path):
    path = tmp_path / "part.stl"
    solid = trimesh.Trimesh(CORNERS, TETRAHEDRON, process=False)
    path.write_text(trimesh.exchange.stl.export_stl_ascii(solid))
    assert load_mesh(path, "mm").volume == pytest.approx(30e-3 * 20e-3 * 10e-3 / 6.0)


def test_a_file_in_metres_stays_as_it_is(tmp_path):
    assert load_mesh(write(tmp_path / "part.stl"), "m").vertices.max() == pytest.approx(30.0)


def test_a_solid_facing_inwards_is_turned_inside_out(tmp_path):
    path = write(tmp_path / "part.stl", faces=TETRAHEDRON[:, ::-1])
    assert load_mesh(path, "mm").volume > 0.0


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (CORNERS, TETRAHEDRON[:3], r"is not closed: 3 edges .* near \("),
        (CORNERS[:3], np.array([[0, 1, 2], [0, 2, 1]]), "encloses no volume"),
        (CORNERS, np.vstack([TETRAHEDRON[:3], [[0, 2, 3]]]), "face opposite sides"),
        (CORNERS * np.array([1.0, np.nan, 1.0]), TETRAHEDRON, "not finite|is not a mesh|no tri"),
    ],
)
def test_what_is_not_a_solid_is_refused(tmp_path, vertices, faces, message):
    path = write(tmp_path / "part.ply", vertices, faces)
    with pytest.raises(InputError, match=message) as caught:
        load_mesh(path, "mm")
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("suffix", [".stl", ".ply", ".obj"])
@pytest.mark.parametrize("content", [b"", b"\x00\x01garbage\xff" * 30, b"solid x\nendsolid x\n"])
def test_what_is_not_a_mesh_is_refused(tmp_path, suffix, content):
    path = tmp_path / f"part{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"is not a mesh|holds no triangles|is not closed"):
        load_mesh(path, "mm")


@pytest.mark.parametrize("suffix", [".stl", ".ply"])
def test_a_mesh_of_too_many_triangles_is_refused_as_that(tmp_path, monkeypatch, suffix):
    monkeypatch.setattr("opl.geometry.mesh_file.MOST_TRIANGLES", 3)
    with pytest.raises(InputError, match=r"has 4 triangles, at most 3 are taken; export a coarser"):
        read_triangles(write(tmp_path / f"part{suffix}"))


def test_a_missing_file_and_an_unknown_format_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_mesh(tmp_path / "none.stl", "mm")
    with pytest.raises(InputError, match=r"must be one of \.stl, \.ply, \.obj"):
        load_mesh(tmp_path / "part.step", "mm")


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (CORNERS[:, :2], TETRAHEDRON, "vertices: "),
        (np.full((3, 3), np.inf), TETRAHEDRON[:1], "vertices: "),
        (CORNERS, TETRAHEDRON[:, :2], "faces: must have shape"),
        (CORNERS, TETRAHEDRON + 1, "faces: indices must lie between 0 and 3"),
        (CORNERS, TETRAHEDRON - 1, "faces: indices must lie between 0 and 3"),
    ],
)
def test_a_mesh_refuses_wrong_shapes_and_indices(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        TriangleMesh(vertices, faces)


def test_arrays_are_read_only_copies():
    vertices = CORNERS.copy()
    mesh = TriangleMesh(vertices, TETRAHEDRON)
    vertices[:] = 7.0
    assert mesh.vertices[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.faces[0, 0] = 3


def test_the_v_solid_lies_under_its_surface_and_nowhere_deeper_than_a_hundredth_millimetre():
    part = folder("workpieces") / "v_shape"
    mesh = load_mesh(part / "v_shape.stl", "mm")
    surface = load_surface(part / "surface.json")
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # the solid is convex: the largest height over its faces is the height over the solid
    lower, upper = surface.domain
    uv = np.random.default_rng(0).uniform(lower, upper, (3000, 2))
    heights = np.einsum("kmi,mi->km", surface.point(uv)[:, None] - a, normals).max(axis=1)
    assert heights.min() > -1e-8
    assert heights.max() < 0.01e-3 + 1e-8


def test_the_corners_of_the_v_solid_lie_on_its_surface_but_for_single_precision():
    mesh = load_mesh(folder("workpieces") / "v_shape" / "v_shape.stl", "mm")
    assert np.abs(profile_distance(1e3 * mesh.vertices[:, 1:])).max() < 1e-5
    np.testing.assert_allclose(np.abs(mesh.vertices[:, 0]), 12.5e-3)


def test_centre_of_volume_is_that_of_a_pyramid_wherever_it_stands():
    """A quarter of the height above the base, in the closed form; turned and moved with it."""
    corners = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.4]], dtype=float)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8])
    for move in (np.zeros(3), np.array([5.0, -3.0, 2.0])):
        mesh = TriangleMesh(turn.apply(corners) + move, faces)
        assert mesh.volume == pytest.approx(0.3 * 0.2 * 0.4 / 6.0)
        wanted = turn.apply([0.075, 0.05, 0.1]) + move
        np.testing.assert_allclose(mesh.centre_of_volume, wanted, atol=1e-9)
