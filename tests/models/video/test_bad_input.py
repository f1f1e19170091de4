"""What is no usable video ends in one clear sentence; what is damaged gives all that decodes, and a warning."""

import gc
import io
import struct
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from humanmm.errors import VideoError
from humanmm.models.video import container as opening
from humanmm.models.video import reading
from humanmm.models.video.declared_size import declared_sides_px
from humanmm.models.video.frames import frames
from humanmm.models.video.reading import read_facts

Clip = Callable[..., io.BytesIO]
NumberOf = Callable[[np.ndarray], int]


def refusal(file: io.BytesIO) -> str:
    with pytest.raises(VideoError) as raised:
        read_facts(file)
    message = str(raised.value)
    assert "\n" not in message
    assert len(message) < 250
    return message


def test_an_empty_file_is_refused() -> None:
    assert "empty" in refusal(io.BytesIO(b""))


@pytest.mark.parametrize(
    "content", [b"hello\n" * 1000, bytes(range(256)) * 64, b"#EXTM3U\n#EXTINF:1,\n/etc/hostname\n"]
)
def test_what_is_no_video_is_refused(content: bytes) -> None:
    assert "not a video" in refusal(io.BytesIO(content))


def test_a_playlist_never_opens_the_files_that_it_names(tmp_path: Path, clip: Clip) -> None:
    (tmp_path / "real.mp4").write_bytes(clip().getvalue())
    playlist = tmp_path / "playlist.mp4"
    playlist.write_text(f"ffconcat version 1.0\nfile '{tmp_path}/real.mp4'\n")
    with playlist.open("rb") as stream, pytest.raises(VideoError, match="not a video"):
        read_facts(stream)


def test_sound_alone_is_refused() -> None:
    file = io.BytesIO()
    with av.open(file, "w", format="mp4") as out:
        stream = out.add_stream("aac", rate=44100, layout="mono")
        for i in range(20):
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
            frame.sample_rate, frame.pts = 44100, 1024 * i
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    assert "no moving pictures" in refusal(file)


def test_one_picture_is_no_motion(clip: Clip) -> None:
    assert "one picture only" in refusal(clip(num_frames=1))


def test_a_video_that_ends_before_its_index_or_in_it_is_said_to_be_cut_off(clip: Clip) -> None:
    whole = clip().getvalue()
    for length in (len(whole) // 2, whole.index(b"moov") - 4, whole.index(b"moov") + 40):
        assert "the file is cut off (its index is missing); copy or" in refusal(io.BytesIO(whole[:length])), length
    assert "not a video, or its header is missing" in refusal(io.BytesIO(bytes(4) + whole[: len(whole) // 2]))


def index_first(whole: bytes) -> bytes:
    """An mp4 with its index moved before the pictures, as files for the web have it."""
    media, index = whole.index(b"mdat") - 4, whole.index(b"moov") - 4
    moov = bytearray(whole[index:])
    at = moov.index(b"stco") + 8
    (count,) = struct.unpack(">I", moov[at : at + 4])
    offsets = struct.unpack(f">{count}I", moov[at + 4 : at + 4 + 4 * count])
    moov[at + 4 : at + 4 + 4 * count] = struct.pack(f">{count}I", *(offset + len(moov) for offset in offsets))
    return whole[:media] + bytes(moov) + whole[media:index]


MEDIA = {"mp4": b"mdat", "matroska": b"\x1f\x43\xb6\x75", "avi": b"movi"}


@pytest.mark.parametrize("container", MEDIA)
def test_of_a_truncated_video_all_that_decodes_is_recovered_with_a_warning(
    container: str, clip: Clip, number_of: NumberOf
) -> None:
    whole = clip(container, "mpeg4", options={"g": "12"}).getvalue()
    if container == "mp4":
        whole = index_first(whole)
    media = whole.index(MEDIA[container])
    file = io.BytesIO(whole[: media + (len(whole) - media) * 6 // 10])
    facts = read_facts(file)
    assert 15 < facts.num_frames < 59
    delivered = [number_of(f.image) for f in frames(file, facts)]
    assert len(delivered) == facts.num_frames
    assert delivered[:-1] == list(range(facts.num_frames - 1))
    assert any("incomplete" in warning for warning in facts.warnings)
    for start in (5, facts.num_frames - 2):
        assert len(list(frames(file, facts, start))) == facts.num_frames - start


def test_a_last_picture_that_stays_is_not_missing(clip: Clip) -> None:
    times = [*range(0, 800, 40), 5000]
    whole = clip("matroska", "mpeg4", times=times).getvalue()
    assert not any("incomplete" in warning for warning in read_facts(io.BytesIO(whole)).warnings)


def test_an_intact_avi_of_variable_rate_is_complete_and_a_shortened_one_is_not(clip: Clip) -> None:
    times = [*range(0, 800, 40), *range(800, 3200, 120)]
    whole = clip("avi", "mjpeg", pix_fmt="yuvj420p", times=times).getvalue()
    facts = read_facts(io.BytesIO(whole))
    assert (facts.num_frames, facts.warnings) == (40, ())
    media = whole.index(b"movi")
    shortened = read_facts(io.BytesIO(whole[: media + (len(whole) - media) * 6 // 10]))
    assert any("the file is incomplete" in warning for warning in shortened.warnings)


def test_a_packet_that_holds_no_picture_as_divx_has_them_is_not_a_missing_one(clip: Clip) -> None:
    file = io.BytesIO()
    with av.open(clip("avi", "mpeg4", num_frames=20)) as source, av.open(file, "w", format="avi") as out:
        stream = out.add_stream_from_template(source.streams.video[0])
        contents = [bytes(packet) for packet in source.demux(source.streams.video[0]) if packet.size]
        first_picture = contents[0].index(b"\x00\x00\x01\xb6")
        contents[0] = contents[0][:first_picture] + b"\x00\x00\x01\xb2DivX503b1393p" + contents[0][first_picture:]
        for i, content in enumerate([contents[0], b"\x7f", *contents[1:]]):
            packet = av.Packet(content)
            packet.stream, packet.dts, packet.pts, packet.time_base = stream, i, i, Fraction(1, 25)
            packet.is_keyframe = i == 0
            out.mux(packet)
    facts = read_facts(io.BytesIO(file.getvalue()))
    assert facts.num_frames == 20
    assert not any("incomplete" in warning or "damaged" in warning for warning in facts.warnings)


@pytest.mark.parametrize(("codec", "pix_fmt"), [("png", "rgb24"), ("rawvideo", "bgra")])
def test_a_packet_that_no_decoder_takes_is_stepped_over(codec: str, pix_fmt: str, clip: Clip) -> None:
    if codec == "png":
        whole = bytearray(clip("mov", codec, pix_fmt=pix_fmt, num_frames=20).getvalue())
        whole[len(whole) // 2] ^= 0x10
    else:
        whole = clip("avi", codec, pix_fmt=pix_fmt, num_frames=20).getvalue()
        whole = whole[: len(whole) * 6 // 10]
    file = io.BytesIO(bytes(whole))
    facts = read_facts(file)
    assert len(list(frames(file, facts))) == facts.num_frames
    assert any("1 packets could not be decoded" in warning for warning in facts.warnings)


@pytest.mark.parametrize("codec", ["libx264", "mpeg4", "libx265"])
def test_damage_in_the_middle_leaves_announced_and_delivered_frames_equal(codec: str, clip: Clip) -> None:
    options = {
        "libx264": {"x264-params": "keyint=12:scenecut=0"},
        "libx265": {"x265-params": "keyint=12:log-level=none"},
        "mpeg4": {"g": "12"},
    }
    whole = bytearray(clip("mp4", codec, options=options[codec]).getvalue())
    generator = np.random.default_rng(3)
    first, last = whole.index(b"mdat") + 600, whole.rindex(b"moov") - 8
    for at in generator.integers(first, last, 12):
        whole[at : at + 8] = generator.bytes(8)
    file = io.BytesIO(bytes(whole))
    facts = read_facts(file)
    assert 1 < facts.num_frames <= 60
    assert [f.index for f in frames(file, facts)] == list(range(facts.num_frames))
    middle = facts.num_frames // 2
    assert [f.index for f in frames(file, facts, middle)] == list(range(middle, facts.num_frames))


def lying_header(file: io.BytesIO, container: str) -> io.BytesIO:
    """The same file, its container declaring 16,384 × 16,384 pixels."""
    data = bytearray(file.getvalue())
    if container == "mp4":
        entry = data.index(b"avc1", data.index(b"stsd")) - 4
        data[entry + 32 : entry + 36] = struct.pack(">HH", 16384, 16384)
    else:
        at = data.index(b"avih") + 40
        data[at : at + 8] = struct.pack("<II", 16384, 16384)
    return io.BytesIO(bytes(data))


@pytest.mark.parametrize("container", ["mp4", "avi"])
def test_absurd_sizes_in_a_header_are_refused_before_anything_is_decoded(container: str, clip: Clip) -> None:
    message = refusal(lying_header(clip(container, num_frames=5), container))
    assert "16384" in message
    assert "max_side_px" in message


def test_a_limit_below_the_pictures_own_size_refuses_every_container(clip: Clip) -> None:
    for container, codec in (("mp4", "libx264"), ("mov", "mpeg4"), ("matroska", "libx264"), ("avi", "mpeg4")):
        file = clip(container, codec, num_frames=5)
        assert max(declared_sides_px(file)) == 128
        with pytest.raises(VideoError, match=r"128 px, more than decode\.max_side_px = 100"):
            read_facts(file, max_side_px=100)


def test_pictures_of_which_a_few_are_more_than_the_memory_limit_are_refused_before_they_are_decoded(
    clip: Clip, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = clip(num_frames=5, pix_fmt="yuv444p")  # a picture and its motion vectors are 43 kB
    assert read_facts(file, max_memory_mb=0.8).num_frames == 5
    monkeypatch.setattr(reading, "_decode_all", None)
    with pytest.raises(VideoError, match=r"h264 keeps several: 0 MB are more than decode\.max_memory_mb = 0; "):
        read_facts(file, max_memory_mb=0.1)


def test_a_decoder_that_keeps_more_than_the_memory_limit_is_stopped(
    clip: Clip, monkeypatch: pytest.MonkeyPatch
) -> None:
    """How many pictures it keeps, a stream may say wrongly: what it takes counts."""
    file, taken_mb = clip(num_frames=20), iter(range(100))
    assert read_facts(file, max_memory_mb=0.2).num_frames == 20
    monkeypatch.setattr(opening, "resident_mb", lambda: 0.05 * next(taken_mb))
    with pytest.raises(VideoError, match=r"128 x 96 px as yuv420p .* decode\.max_memory_mb"):
        read_facts(file, max_memory_mb=0.2)


def test_no_picture_stays_in_memory_when_a_video_has_been_read(clip: Clip) -> None:
    """dav1d frees all of its pictures or none."""
    file = clip(num_frames=5)
    before = _pictures()  # a fixture of another test may hold one
    read_facts(file)
    assert _pictures() == before


def _pictures() -> set[av.VideoFrame]:
    return {thing for thing in gc.get_objects() if type(thing) is av.VideoFrame}


WRITE = """
import sys
import av
import numpy as np
from fractions import Fraction
codec, form, width, height, kind, path = sys.argv[1:]
options = {
    "libx264": {"preset": "ultrafast", "x264-params": "ref=2"},
    "libx265": {"preset": "ultrafast", "x265-params": "log-level=none:ref=1:pools=1:frame-threads=1"},
    "libvpx-vp9": {"deadline": "realtime", "cpu-used": "8"},
    "libsvtav1": {"preset": "13"},
    "mjpeg": {"flags": "+qscale", "global_quality": "3658", "qmin": "31", "qmax": "31"},  # it can write noise then
}
noise = np.random.default_rng(0).integers(0, 256, 1 << 22, dtype=np.uint8).tobytes()
with av.open(path, "w") as out:
    stream = out.add_stream(codec, rate=25, options=options.get(codec, {}))
    stream.width, stream.height, stream.pix_fmt = int(width), int(height), form
    stream.codec_context.thread_count = 1
    picture = av.VideoFrame(int(width), int(height), form)
    for number in range(8):
        for plane in picture.planes:
            size = plane.buffer_size
            plane.update((noise[number:] + noise * (size // len(noise) + 1))[:size] if kind == "noise" else bytes(size))
        picture.pts, picture.time_base = number, Fraction(1, 25)
        out.mux(stream.encode(picture))
    out.mux(stream.encode(None))
"""
READ = """
import re, sys
from humanmm.errors import VideoError
from humanmm.models.video.frames import frames, planar_frames
from humanmm.models.video.reading import read_facts
with open(sys.argv[1], "rb") as file:
    try:
        facts = read_facts(file)
        list(frames(file, facts, pixels="gray", max_side_px=640)), list(frames(file, facts, max_side_px=1920))
        list(planar_frames(file, facts, 0, facts.num_frames, max_side_px=1280))
        print("read", end=" ")
    except VideoError as error:
        assert "decode.max_memory_mb" in str(error), error
        print("refused", end=" ")
# Not getrusage: what it says is at least what the process that started this one took.
print(int(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1]) // 1024)
"""
ALL_CODE_MB = 160
"""What a process with the code of all stages has more than one that only reads."""
NETWORKS_MB = 370
"""And what those of `people` add while it reads (docs/operations.md)."""


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", ["black", "noise"])
@pytest.mark.parametrize(
    ("codec", "form", "width", "height", "outcome"),
    [
        ("mjpeg", "yuvj444p", 8192, 8192, "read"),
        ("mpeg4", "yuv420p", 8176, 8176, "read"),
        ("rawvideo", "bgra", 8192, 8192, "refused"),
        ("rawvideo", "yuv444p", 8192, 8192, "read"),
        ("libx264", "yuv444p", 8192, 8192, "refused"),
        ("libx264", "yuv420p", 8192, 8192, "read"),
        ("libx265", "yuv444p", 8192, 8192, "refused"),
        ("libx265", "yuv420p", 7680, 4320, "read"),
        ("libvpx-vp9", "yuv420p", 8192, 8192, "read"),
        ("libsvtav1", "yuv420p", 8192, 8192, "read"),
    ],
)
def test_the_largest_pictures_take_less_than_1500_mb_or_are_refused(
    codec: str, form: str, width: int, height: int, outcome: str, kind: str, tmp_path: Path
) -> None:
    path = str(tmp_path / ("large.avi" if codec == "rawvideo" else "large.mkv"))
    subprocess.run([sys.executable, "-c", WRITE, codec, form, str(width), str(height), kind, path], check=True)
    done = subprocess.run([sys.executable, "-c", READ, path], check=True, capture_output=True, text=True)
    found, peak_mb = done.stdout.split()
    assert int(peak_mb) < 1500 - ALL_CODE_MB - (NETWORKS_MB if found == "read" else 0), found
    assert found == outcome


def test_frames_left_out_by_an_edit_list_are_not_announced(clip: Clip, number_of: NumberOf) -> None:
    data = bytearray(clip(options={"bf": "0", "x264-params": "keyint=12:scenecut=0"}).getvalue())
    at = data.index(b"elst")
    (duration,) = struct.unpack(">I", data[at + 12 : at + 16])
    # start a quarter into the media: the track's time base is found in mdhd
    timescale = struct.unpack(">I", data[data.index(b"mdhd") + 16 : data.index(b"mdhd") + 20])[0]
    data[at + 12 : at + 20] = struct.pack(">Ii", duration - 600, timescale * 6 // 10)
    file = io.BytesIO(bytes(data))
    facts = read_facts(file)
    numbers = [number_of(f.image) for f in frames(file, facts)]
    assert numbers == list(range(15, 60))
    assert facts.time_s[0] == pytest.approx(0, abs=1e-6)
    assert [number_of(f.image) for f in frames(file, facts, 30, 32)] == [45, 46]


def black(width: int, height: int, pixels: str = "yuv420p") -> av.VideoFrame:
    """A picture that is told: a new one holds what was in memory, which may look interlaced."""
    picture = av.VideoFrame(width, height, pixels)
    for plane in picture.planes:
        plane.update(bytes(plane.buffer_size))
    return picture


def muxed(times: list[int], sizes: list[tuple[int, int]], container: str = "matroska") -> io.BytesIO:
    """A file with one stream of pictures for each size; `times` of its packets are ms, whatever an encoder says."""
    file = io.BytesIO()
    with av.open(file, "w", format=container) as out:
        streams = []
        for width, height in sizes:
            stream = out.add_stream("mpeg4", rate=25)
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            streams.append(stream)
        for number, time in enumerate(times):
            for stream in streams:
                picture = black(stream.width, stream.height)
                picture.pts, picture.time_base = number, Fraction(1, 25)
                for packet in stream.encode(picture):
                    packet.pts = packet.dts = time
                    packet.time_base = Fraction(1, 1000)
                    out.mux(packet)
    file.seek(0)
    return file


TEN_YEARS_MS = 315_360_000_000


@pytest.mark.parametrize(
    ("times", "reported"),
    [
        ([0] * 20, "all 20 pictures of the video have the same time stamp"),
        ([40 * i + TEN_YEARS_MS * (i >= 10) for i in range(20)], "after 0.36 s no picture comes for 315360000 s"),
    ],
)
def test_time_stamps_that_cannot_be_true_are_reported_for_what_they_are(times: list[int], reported: str) -> None:
    message = refusal(muxed(times, [(64, 48)]))
    assert reported in message
    assert "ffmpeg" in message, "what to do"


def test_a_rate_that_no_camera_has_is_reported(clip: Clip) -> None:
    file = clip("mp4", times=list(range(20)), time_base=Fraction(1, 1_000_000))
    assert "20 pictures in 0.000019 s: the time stamps are wrong" in refusal(file)


def test_a_track_without_pictures_is_reported() -> None:
    whole = muxed([0], [(64, 48)], "avi").getvalue()
    assert "its track is empty" in refusal(io.BytesIO(whole.replace(b"00dc", b"JUNK")))


def test_equal_time_stamps_are_reported_from_such_that_run_backwards() -> None:
    facts = read_facts(muxed([40 * (i - (i == 7)) for i in range(20)], [(64, 48)]))
    assert facts.num_frames == 19
    assert any(one.startswith("1 pictures have the time stamp of the one before") for one in facts.warnings)
    assert not any("earlier" in one for one in facts.warnings)
    assert reading._unusable_times([0, 40, 40, 80, 60, 120]) == (1, 1), "no muxer of ours writes the second kind"


def test_a_long_gap_is_a_warning() -> None:
    facts = read_facts(muxed([40 * i + 60_000 * (i >= 10) for i in range(20)], [(64, 48)]))
    assert facts.num_frames == 20
    (warning,) = facts.warnings
    assert warning.startswith("after 0.36 s no picture comes for 60.0 s: the recording stood still, or pictures are ")


def test_a_hole_is_a_warning_in_a_video_of_steady_rate_and_ordinary_where_pictures_stand_still() -> None:
    hole = [40 * i + 4370 * (i >= 10) for i in range(20)]
    assert any("no picture comes for 4.4 s" in warning for warning in read_facts(muxed(hole, [(64, 48)])).warnings)
    of_a_screen = [0, 40, 80, 400, 440, 1500, 1540, 1580, 1620, 5900, 5940, 5980, 7000, 7040, 7080, 7120]
    assert not read_facts(muxed(of_a_screen, [(64, 48)])).warnings
    halved = [80 * i + 900 * (i >= 10) for i in range(20)]
    assert not read_facts(muxed(halved, [(64, 48)])).warnings, "a second is what a pause between two pictures may be"


@pytest.mark.parametrize(
    ("container", "codec"),
    [("mp4", "libx264"), ("matroska", "mpeg4"), ("mpegts", "mpeg4"), ("flv", "libx264")],
)
def test_of_videos_one_after_the_other_the_first_is_read_and_the_others_are_reported(
    container: str, codec: str, clip: Clip, number_of: NumberOf
) -> None:
    file = io.BytesIO(clip(container, codec).getvalue() * 2)
    facts = read_facts(file)
    assert [number_of(f.image) for f in frames(file, facts)] == list(range(60))
    assert any("one after the other" in warning for warning in facts.warnings)


def test_of_two_streams_one_is_read_and_the_other_is_reported() -> None:
    facts = read_facts(muxed([40 * i for i in range(20)], [(64, 48), (128, 96)]))
    (warning,) = facts.warnings
    assert "2 streams of pictures; the one of 20 pictures" in warning


JPEG_PX = 640, 480


def picture_file() -> bytes:
    """A JPEG picture."""
    file = io.BytesIO()
    with av.open(file, "w", format="mjpeg") as out:
        stream = out.add_stream("mjpeg", rate=1)
        (stream.width, stream.height), stream.pix_fmt = JPEG_PX, "yuvj420p"
        out.mux(stream.encode(black(*JPEG_PX, "yuvj420p")))
        out.mux(stream.encode(None))
    return file.getvalue()


@pytest.mark.parametrize("with_video", [True, False])
@pytest.mark.parametrize("is_flagged", [True, False])
@pytest.mark.parametrize("container", ["mp4", "mov", "matroska"])
def test_a_cover_picture_beside_a_video_is_not_taken_for_it(container: str, is_flagged: bool, with_video: bool) -> None:
    file = io.BytesIO()
    with av.open(file, "w", format=container) as out:
        if container == "matroska" and is_flagged:
            out.add_attachment("cover.jpg", "image/jpeg", picture_file())
            picture = None
        else:
            picture = out.add_stream("mjpeg", rate=1)
            (picture.width, picture.height), picture.pix_fmt = JPEG_PX, "yuvj420p"
            if is_flagged:
                picture.disposition = av.stream.Disposition.attached_pic
        if with_video:
            video = out.add_stream("mpeg4", rate=25)
            video.width, video.height, video.pix_fmt = 128, 96, "yuv420p"
        else:
            sound = out.add_stream("aac", rate=44100, layout="mono")
        if picture is not None:
            packet = av.Packet(picture_file())
            packet.stream, packet.pts, packet.dts, packet.time_base = picture, 0, 0, Fraction(1, 25)
            out.mux(packet)
        if with_video:
            for _ in range(20):
                out.mux(video.encode(black(128, 96)))
            out.mux(video.encode(None))
        else:
            for number in range(3):
                samples = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
                samples.sample_rate, samples.pts = 44100, 1024 * number
                out.mux(sound.encode(samples))
            out.mux(sound.encode(None))
    if with_video:
        facts = read_facts(file)
        assert (facts.num_frames, facts.width) == (20, 128)
        assert len(list(frames(file, facts))) == 20
        assert len(facts.warnings) == (0 if is_flagged else 1)
    else:
        assert ("no moving pictures" if is_flagged else "one picture only") in refusal(file)


def test_an_edit_list_that_shows_nothing_is_told() -> None:
    assert "edit list leaves out all of them" in refusal(muxed([-2000 + 40 * i for i in range(20)], [(64, 48)], "mp4"))


def test_a_packet_that_is_as_large_as_its_picture_counts_too(clip: Clip, monkeypatch: pytest.MonkeyPatch) -> None:
    """A picture of 128 x 96 px is 49 kB as bgra."""
    monkeypatch.setattr(opening, "resident_mb", lambda: 0.0)
    file = clip("avi", "rawvideo", num_frames=3, pix_fmt="bgra")
    assert read_facts(file, max_memory_mb=0.2).num_frames == 3
    with pytest.raises(VideoError, match=r"decode\.max_memory_mb"):
        read_facts(file, max_memory_mb=0.19)
