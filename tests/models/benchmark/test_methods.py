"""The compared methods on one short video: the pipeline is good, the paper's baseline is not."""

from humanmm.models.benchmark.methods import METHODS, MethodMotion, VideoMotions
from humanmm.models.benchmark.scores import MethodFigures, score
from humanmm.models.synthetic.multishot import BenchVideo


def _value(figures: MethodFigures, name: str) -> float:
    return next(figure.value for figure in figures.figures if figure.name == name)


def test_every_method_is_scored_and_the_baseline_is_bad_as_in_the_paper(
    video: BenchVideo, motions: VideoMotions
) -> None:
    *known, unknown = score(video, motions).methods
    scored = {one.method: one for one in known}
    assert tuple(scored) == METHODS
    assert not any(one.failure for one in known)
    assert "'oracle luck'" in unknown.failure and not unknown.figures
    ours, concat, oracle = (scored[name] for name in ("humanmm", "concat", "oracle camera rotation"))
    assert _value(ours, "wa_mpjpe100_mm") < 150
    assert _value(concat, "wa_mpjpe100_mm") > _value(ours, "wa_mpjpe100_mm")
    assert _value(concat, "roe_deg") > 30
    # The solver may rotate a shot a little even when the rotation is known.
    assert _value(oracle, "cam_cut_rot_deg") < 2
    assert _value(scored["oracle camera"], "cam_cut_rot_deg") < 2
    assert _value(scored["oracle camera"], "focal_err_pct") < 0.1
    assert _value(scored["oracle yaw"], "cam_cut_rot_deg") < _value(ours, "cam_cut_rot_deg")
    assert scored["oracle cuts"].figures == ours.figures  # the cuts of such a video are given
    assert len(ours.cuts) == 2
    lost = [(cut.frame, cut.angle_deg, cut.error_deg) for cut in unknown.cuts]
    assert lost == [(cut.frame, cut.angle_deg, None) for cut in ours.cuts], "failing hides no cut"


def test_an_unknown_method_is_a_failure_of_its_own(motion_of: dict[str, MethodMotion]) -> None:
    assert [name for name, done in motion_of.items() if done.motion is None] == ["oracle luck"]
    assert "'oracle luck'" in motion_of["oracle luck"].reason
