#!/usr/bin/env python3
"""Does the reference see what an independent ray tracer sees?

Usage: ruler_check.py POLYPTYCH [MODELS]

Draws ten meshes with the reference (distance channel) and casts the same rays with Embree (package `embreex`). They must
hit the same pixels, but for single ones on outlines, and agree on the distance to 1e-5 of it. Embree computes in single
precision, so it is the coarser of the two. Says "skipped" in one line and ends with 0 where embreex or the models are
missing. Exit code 1 where they disagree.
"""
import os
import pathlib
import subprocess
import sys
import tempfile

MESHES = ["stanford-bunny", "cow", "suzanne", "teapot", "fandisk", "airplane", "dragon_res3", "cgal/elephant",
          "truth/torus_96", "truth/sphere_32x64"]
WIDTH, HEIGHT, FOV = 400, 300, 40.0
OUTLINE_SHARE = 1e-4  # of all pixels: rays that graze an edge may fall on either side
DISTANCE = 1e-5


def read_obj(path, numpy):
    points, triangles = [], []
    for line in path.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(w) for w in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(w.split("/")[0]) - 1 for w in words[1:]]
            triangles += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
    return numpy.array(points), numpy.array(triangles, dtype=numpy.int32)


def read_pfm(path, numpy):
    with path.open("rb") as file:
        assert file.readline().strip() == b"PF"
        width, height = map(int, file.readline().split())
        file.readline()
        return numpy.frombuffer(file.read(), "<f4").reshape(height, width, 3)[::-1, :, 0].astype(float)


def rays(eye, target, numpy):
    unit = lambda v: v / numpy.linalg.norm(v)
    forward = unit(target - eye)
    right = unit(numpy.cross(forward, [0.0, 1.0, 0.0]))
    up = numpy.cross(right, forward)
    x, y = numpy.meshgrid((numpy.arange(WIDTH) + 0.5) / WIDTH * 2 - 1, 1 - (numpy.arange(HEIGHT) + 0.5) / HEIGHT * 2)
    half = numpy.tan(numpy.radians(FOV) / 2)
    directions = forward + x[..., None] * half * WIDTH / HEIGHT * right + y[..., None] * half * up
    return directions / numpy.linalg.norm(directions, axis=-1, keepdims=True)


def check(polyptych, model, folder, embree, numpy):
    mesh = folder / "mesh.obj"
    subprocess.run([polyptych, "convert", model, mesh], check=True, stdout=subprocess.DEVNULL)
    points, triangles = read_obj(mesh, numpy)
    center, radius = (points.min(0) + points.max(0)) / 2, numpy.linalg.norm(points.max(0) - points.min(0)) / 2
    eye = center + radius * numpy.array([1.3, 0.9, 2.1])
    place = lambda v: ",".join(repr(float(c)) for c in v)
    picture = folder / "distance.pfm"
    subprocess.run([polyptych, "render", mesh, "-b", "reference", "--channel", "distance", "--size", f"{WIDTH}x{HEIGHT}",
                    "--eye", place(eye), "--target", place(center), "--fov", str(FOV), "-q", "-o", picture], check=True)
    ours = read_pfm(picture, numpy)
    directions = rays(eye, center, numpy).reshape(-1, 3)
    scene = embree.rtcore_scene.EmbreeScene(robust=True)
    # From the eye, so that single precision loses least.
    embree.mesh_construction.TriangleMesh(scene, (points - eye).astype(numpy.float32), triangles)
    origins = numpy.zeros_like(directions, dtype=numpy.float32)
    hits = scene.run(origins, directions.astype(numpy.float32), query="DISTANCE")
    theirs = hits.reshape(HEIGHT, WIDTH).astype(float)
    seen = (numpy.isfinite(ours), theirs < 1e30)
    differ = int((seen[0] != seen[1]).sum())
    both = seen[0] & seen[1]
    off = numpy.abs(ours[both] - theirs[both]) / ours[both]
    # A ray that grazes an edge meets another surface behind it: such single pixels are outlines, too.
    grazing = int((off > DISTANCE).sum())
    allowed = OUTLINE_SHARE * WIDTH * HEIGHT
    passed = both.sum() > 1000 and differ + grazing <= allowed
    print(f"{'ok    ' if passed else 'FAILED'} {model.stem}: {len(triangles)} triangles, {both.sum()} pixels seen by both, {differ} by one, "
          f"{grazing} at another distance; distance off by {numpy.median(off):.1e} (median), {numpy.quantile(off, 0.999):.1e} (99.9 %)")
    return passed


def main():
    here = pathlib.Path(__file__).resolve().parent.parent
    polyptych = pathlib.Path(sys.argv[1]).resolve()
    models = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else os.environ.get("POLYPTYCH_MODELS", here.parent / "shared/models"))
    try:
        import embreex.mesh_construction
        import embreex.rtcore_scene
        import numpy
    except ImportError as error:
        print(f"skipped: the independent check of the reference needs the Python packages embreex and numpy ({error})")
        return 0
    files = [models / "mesh" / f"{name}.obj" for name in MESHES]
    if not all(file.exists() for file in files):
        print(f"skipped: the independent check of the reference needs the models of {models}")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        results = [check(polyptych, file, pathlib.Path(folder), embreex, numpy) for file in files]
    print(f"{sum(results)} of {len(results)} meshes agree")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
