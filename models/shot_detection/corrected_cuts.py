"""Cuts that the user adds and removes, in place of those that were found."""

from collections.abc import Sequence
from dataclasses import replace

from humanmm.corrections import AddCut, Corrections, RemoveCut
from humanmm.models.records.shots import CorrectionNote, Scenes, Transition

NEAR_FRAMES = 2
"""A cut this near to the frame that the user names is the one that he means."""
FOUND_BY_USER = "user"


def corrected_scenes(scenes: Scenes, corrections: Corrections) -> Scenes:
    """The scenes without the cuts to be removed, and with those to be added; notes say which corrections fit. What the
    user says of a suspected cut settles it.

    A cut that is added takes the place of one that was found within NEAR_FRAMES, and of a gradual transition around it.
    """
    kept, notes = removed(scenes.transitions, corrections.of(RemoveCut))
    for correction in corrections.of(AddCut):
        end = correction.frame if correction.end is None else correction.end
        if end >= scenes.num_frames:
            last = scenes.num_frames - 1
            notes.append(CorrectionNote(correction.identity, False, f"the video ends with frame {last}"))
            continue
        added = Transition("cut" if correction.end is None else "dissolve", correction.frame, end, FOUND_BY_USER)
        same = [t for t in kept if (t.start, t.end) == (added.start, added.end)]
        if same:
            notes.append(CorrectionNote(correction.identity, True, "it is found without the correction, too"))
            continue
        kept = [t for t in kept if not _overlap(t, added)]
        kept.append(added)
        notes.append(CorrectionNote(correction.identity, True))
    suspected, notes = settled(scenes.suspected, notes, corrections)
    return Scenes(
        scenes.num_frames, tuple(sorted(kept, key=lambda t: t.start)), tuple(notes), suspected, scenes.changes
    )


def settled(
    suspected: Sequence[int], notes: Sequence[CorrectionNote], corrections: Corrections
) -> tuple[tuple[int, ...], list[CorrectionNote]]:
    """The suspected cuts of which the user says nothing, and the notes, in which a correction fits that says of a
    suspected cut that it is none."""
    refused = corrections.of(RemoveCut)
    said = [one.frame for one in corrections.of(AddCut)] + [one.frame for one in refused]
    useful = {one.identity for one in refused if any(abs(one.frame - frame) <= NEAR_FRAMES for frame in suspected)}
    return (
        tuple(frame for frame in suspected if all(abs(frame - other) > NEAR_FRAMES for other in said)),
        [replace(note, applied=True, reason="") if note.identity in useful else note for note in notes],
    )


def removed(
    transitions: Sequence[Transition], corrections: Sequence[RemoveCut], *, fixed: Sequence[Transition] = ()
) -> tuple[list[Transition], list[CorrectionNote]]:
    """The transitions that stay, and a note for each correction; those that are `fixed` stay anyway."""
    kept, notes = list(transitions), []
    for correction in corrections:
        near = [t for t in kept if t not in fixed and distance(t, correction.frame) <= NEAR_FRAMES]
        if near:
            nearest = min(near, key=lambda t: distance(t, correction.frame))
            kept.remove(nearest)
            notes.append(CorrectionNote(correction.identity, True))
        else:
            others = sorted(kept, key=lambda t: distance(t, correction.frame))
            nearest_one = f"; the nearest is at frame {others[0].cut_frame}" if others else ""
            notes.append(CorrectionNote(correction.identity, False, f"no cut is found there{nearest_one}"))
    return kept, notes


def distance(transition: Transition, frame: int) -> int:
    """Frames from a frame to a transition; 0 at a cut and inside a gradual one."""
    return max(transition.start - frame, frame - transition.end, 0)


def _overlap(transition: Transition, added: Transition) -> bool:
    return transition.start <= added.end + NEAR_FRAMES and added.start <= transition.end + NEAR_FRAMES
