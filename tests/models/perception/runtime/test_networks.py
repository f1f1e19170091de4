"""Where networks run: on a device that is there and computes the same, else on the processor."""

from collections.abc import Iterator

import numpy as np
import pytest

from humanmm.errors import StageError
from humanmm.models.perception import blazepose, movenet
from humanmm.models.perception.keypoints.fusion import locate_best
from humanmm.models.perception.picture import Picture, whole
from humanmm.models.perception.runtime import device, networks
from humanmm.models.perception.runtime.inner import showing
from humanmm.models.perception.runtime.litert import InterpreterPool
from humanmm.models.weights.shipped import read_weights

HAND = "hand_landmark_lite.tflite"


@pytest.fixture
def one_device(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine with a CUDA device, whose part torch's processor plays."""
    monkeypatch.setattr(networks, "nvidia_devices", lambda: 1)
    monkeypatch.setattr(device, "is_there", lambda: True)
    monkeypatch.setattr(device, "CUDA", "cpu")
    networks._loaded.cache_clear()
    yield
    networks._loaded.cache_clear()


@pytest.mark.usefixtures("one_device")
def test_what_looks_at_crops_runs_on_a_device_and_what_looks_at_pictures_on_the_processor() -> None:
    assert isinstance(networks.network(HAND), device.DeviceNetwork)
    assert networks.network(HAND) is networks.network(HAND)
    assert isinstance(networks.network("movenet-multipose.tflite", (1, 64, 64, 3)), InterpreterPool)


def test_who_is_seen_on_a_real_frame_is_the_same_on_a_device(
    monkeypatch: pytest.MonkeyPatch, clip_picture: Picture
) -> None:
    region = movenet.detect(clip_picture, whole(clip_picture))[0].region
    processor = locate_best(clip_picture, region)
    asked: list[str] = []

    def on_device(name: str) -> device.DeviceNetwork:
        asked.append(name)
        return device.DeviceNetwork(showing(read_weights(name), networks.INNER.get(name, {})), "cpu")

    for module in (blazepose, movenet):
        monkeypatch.setattr(module, "network", on_device)
    found = locate_best(clip_picture, region)
    assert asked == ["pose_landmark_heavy.tflite", "movenet-thunder.tflite"]
    np.testing.assert_allclose(found.landmarks3d, processor.landmarks3d, atol=1e-4)  # metres
    np.testing.assert_allclose(found.keypoints[:, :2], processor.keypoints[:, :2], atol=0.01)  # pixels
    np.testing.assert_allclose(found.keypoints[:, 2], processor.keypoints[:, 2], atol=1e-3)


@pytest.mark.usefixtures("one_device")
@pytest.mark.parametrize(("visible", "told"), [(None, 1), ("0", 1), ("", 0)])
def test_without_a_device_that_torch_can_use_networks_run_on_the_processor_and_say_so_once(
    monkeypatch: pytest.MonkeyPatch, visible: str | None, told: int
) -> None:
    monkeypatch.setattr(device, "is_there", lambda: False)
    if visible is None:
        monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    else:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", visible)
    said: list[str] = []
    monkeypatch.setattr(networks.log, "warning", said.append)
    networks._tell_unused.cache_clear()
    for name in (HAND, "movenet-thunder.tflite"):
        assert isinstance(networks.network(name), InterpreterPool)
    assert [sentence.partition(":")[0] for sentence in said] == ["torch cannot use the NVIDIA device"] * told


@pytest.mark.usefixtures("one_device")
@pytest.mark.parametrize("wrong", [1.01, np.nan])
def test_a_device_that_computes_something_else_is_refused(monkeypatch: pytest.MonkeyPatch, wrong: float) -> None:
    honest = device.DeviceNetwork.run

    def run(self: device.DeviceNetwork, tensor: np.ndarray, wanted: tuple[str, ...] = ()) -> list[np.ndarray]:
        return [output * np.float32(wrong) for output in honest(self, tensor, wanted)]

    monkeypatch.setattr(device.DeviceNetwork, "run", run)
    with pytest.raises(StageError, match=r"computes hand_landmark_lite\.tflite otherwise .* CUDA_VISIBLE_DEVICES="):
        networks.network(HAND)
