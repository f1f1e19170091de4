"""Universal Scene Description, through usd-core (Pixar's own package): skinned people and cameras in one scene.

z up, metres by default. Time codes are frames at the mean rate; times stay exact. A person is invisible
before his first frame, after his last, and where he is not seen for long; a camera has its focal length in every frame.
"""

from pathlib import Path
from typing import Any

import numpy as np

from humanmm.errors import InputError
from humanmm.models.body.fingers import body_of
from humanmm.models.drawing.palette import person_color
from humanmm.models.drawing.surface import vertex_normals
from humanmm.models.geometry.rotations import rotmat_to_unitquat_wxyz
from humanmm.models.motion.excerpt import Excerpt
from humanmm.models.motion.worlds import world_of_person
from humanmm.models.records.recording import RecordedPerson
from humanmm.storage.run_folder.exporters.gltf_scene import FAR_M, NEAR_M

_APERTURE = 0.36
"""Width of the film in tenths of a metre: usd measures lenses in tenths of the scene's unit."""


def write_usd(excerpt: Excerpt, path: Path) -> None:
    """The scene as a binary usd file. InputError if usd-core is not installed."""
    try:
        from pxr import Usd, UsdGeom
    except ImportError:
        raise InputError("usd files need the package usd-core: pip install 'humanmm[usd]'") from None
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, excerpt.up.upper())
    UsdGeom.SetStageMetersPerUnit(stage, 1 / excerpt.scale)
    stage.SetTimeCodesPerSecond(excerpt.fps)
    stage.SetFramesPerSecond(excerpt.fps)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(float(excerpt.seconds[-1] * excerpt.fps))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/humanmm").GetPrim())
    for person in excerpt.recording.people:
        _add_person(stage, excerpt, person)
    for frames in excerpt.shots():
        _add_camera(stage, excerpt, frames)
    stage.Save()


def _codes(excerpt: Excerpt, frames: Any) -> list[float]:
    """Time codes of frames."""
    codes: list[float] = (excerpt.seconds[frames] * excerpt.fps).tolist()
    return codes


def _add_person(stage: Any, excerpt: Excerpt, person: RecordedPerson) -> None:
    from pxr import Gf, Sdf, UsdGeom, UsdSkel, Vt

    place = f"/humanmm/person_{person.person:02d}"
    root = UsdSkel.Root.Define(stage, place)
    _show(root, excerpt, person)
    body, rest = body_of(person), excerpt.rest_joints(person)
    names: list[str] = []
    for name, parent in zip(body.joint_names, body.parents, strict=True):
        names.append(f"{names[parent]}/{name}" if parent >= 0 else name)
    offsets = np.array([rest[j] - rest[parent] if j else rest[j] for j, parent in enumerate(body.parents)])
    skeleton = UsdSkel.Skeleton.Define(stage, f"{place}/skeleton")
    skeleton.CreateJointsAttr(names)
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(*p)) for p in rest.tolist()])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(*p)) for p in offsets.tolist()])
    animation = UsdSkel.Animation.Define(stage, f"{place}/skeleton/motion")
    animation.CreateJointsAttr(names)
    animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1)] * len(names)))
    turns, steps = animation.CreateRotationsAttr(), animation.CreateTranslationsAttr()
    pelvis = excerpt.points(person.pelvis)
    for row, code in enumerate(_codes(excerpt, person.frame)):
        wxyz = rotmat_to_unitquat_wxyz(excerpt.local_rotations(person, slice(row, row + 1))[0])
        turns.Set(Vt.QuatfArray([Gf.Quatf(*one) for one in wxyz.tolist()]), code)
        offsets[0] = pelvis[row]
        steps.Set(Vt.Vec3fArray.FromNumpy(offsets.astype(np.float32)), code)
    binding = UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    binding.CreateAnimationSourceRel().SetTargets([animation.GetPath()])

    mesh = UsdGeom.Mesh.Define(stage, f"{place}/body")
    vertices = excerpt.scale * body.rest_vertices(person.betas) @ excerpt.R_file_body.T
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(vertices.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray([3] * len(body.faces)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(body.faces.reshape(-1).astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    normals = vertex_normals(body, body.rest_vertices(person.betas)) @ excerpt.R_file_body.T
    mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    color = [(channel / 255) ** 2.2 for channel in person_color(person)]
    mesh.CreateDisplayColorAttr([Gf.Vec3f(*color)])
    bound = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    bound.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    bound.CreateJointIndicesPrimvar(False, 4).Set(Vt.IntArray.FromNumpy(body.skin_joint.reshape(-1).astype(np.int32)))
    bound.CreateJointWeightsPrimvar(False, 4).Set(
        Vt.FloatArray.FromNumpy(body.skin_weight.reshape(-1).astype(np.float32))
    )
    bound.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
    observed = Vt.IntArray.FromNumpy(person.observed.astype(np.int32))
    root.GetPrim().CreateAttribute("humanmm:observed", Sdf.ValueTypeNames.IntArray).Set(observed)
    world = world_of_person(excerpt.recording, person)
    root.GetPrim().CreateAttribute("humanmm:world", Sdf.ValueTypeNames.Int).Set(world)


def _show(root: Any, excerpt: Excerpt, person: RecordedPerson) -> None:
    """Visible where the person is shown."""
    from pxr import UsdGeom

    shown, codes = excerpt.shown(person), _codes(excerpt, slice(None))
    visible = UsdGeom.Imageable(root).CreateVisibilityAttr()
    if not shown.all():
        for frame in (0, *np.flatnonzero(np.diff(shown)) + 1):
            visible.Set("inherited" if shown[frame] else "invisible", codes[frame])


def _add_camera(stage: Any, excerpt: Excerpt, frames: slice) -> None:
    from pxr import Gf, Sdf, UsdGeom

    recording = excerpt.recording
    shot = excerpt.shot_of(frames)
    camera = UsdGeom.Camera.Define(stage, f"/humanmm/camera_shot_{shot:03d}")
    camera.GetPrim().CreateAttribute("humanmm:world", Sdf.ValueTypeNames.Int).Set(recording.world_of_shot(shot))
    K = recording.K[frames].astype(np.float64)
    fx, fy = np.median(K[:, 0, 0]), np.median(K[:, 1, 1])
    aperture = _APERTURE * excerpt.scale
    camera.CreateHorizontalApertureAttr(aperture)
    camera.CreateVerticalApertureAttr(float(aperture * recording.height / recording.width * fx / fy))
    camera.CreateClippingRangeAttr(Gf.Vec2f(NEAR_M * excerpt.scale, FAR_M * excerpt.scale))
    focal, place = camera.CreateFocalLengthAttr(), camera.AddTransformOp()
    R, t = excerpt.cameras(frames)
    for row, code in enumerate(_codes(excerpt, frames)):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = R[row], t[row]
        place.Set(Gf.Matrix4d(pose.T.tolist()), code)
        focal.Set(float(K[row, 0, 0] / recording.width * aperture), code)
