"""What `--help` of each command shows as examples; a test reads every one of them as the command line would."""

from collections.abc import Mapping

EXAMPLES: Mapping[str, tuple[tuple[str, str], ...]] = {
    "recover": (
        ("humanmm recover film.mp4", "writes runs/film; run it again to go on where it was stopped"),
        ("humanmm recover a.mp4 b.mp4 clips --out results", "two videos and all of a folder, one after the other"),
        ("humanmm recover film.mp4 --dry-run", "says what would be computed, and why"),
        ("humanmm recover film.mp4 --person 0 --fov-deg 65", "the main person alone, with a known lens"),
        ("humanmm recover film.mp4 --hmr-from hmr4d_results.pt", "bodies of another system, joined and refined"),
        ("humanmm recover film.mp4 --only camera --shot 1", "one stage of one shot again, then what it changes"),
        ("humanmm recover film.mp4 --people.pose fast", "a setting; --config FILE.toml holds many"),
    ),
    "camera": (
        ("humanmm camera film.mp4 --out cameras", "a TUM trajectory a shot, and cameras.json"),
        ("humanmm camera empty_room.mp4 --fov-deg 65", "nobody need be in view"),
    ),
    "eval": (("humanmm eval runs/film film_gt.npz --json", "every figure, for a program"),),
    "export": (
        ("humanmm export runs/film --format bvh", "one file a person into runs/film/export"),
        ("humanmm export runs/film --format glb --person 0 --start 2 --end 5.5", "one person, a span"),
        ("humanmm export runs/film --format trc --fps 100 --up y --unit mm --out opensim", "for OpenSim"),
    ),
    "view": (
        ("humanmm view runs/film", "video and world in the browser"),
        ("humanmm view runs/film --mp4 side-by-side", "a film to show around"),
    ),
    "status": (("humanmm status runs/film", "what of it is stale, and why"),),
    "explain": (("humanmm explain runs/film camera --shot 1", "what the camera of shot 1 was computed from"),),
    "serve": (("humanmm serve --limit 4", "four videos at the same time"),),
    "batch submit": (
        ("humanmm batch submit films --dry-run", "says what would be scheduled"),
        ("humanmm batch submit films --out runs --wait", "every video of a folder, and wait for the last one"),
        ("humanmm batch submit films.csv --name monday", "what a manifest lists, with settings of its own"),
        ("humanmm batch submit inbox --watch", "stay, and take what comes"),
    ),
    "batch status": (("humanmm batch status monday --json", "for a program"),),
    "batch retry-failed": (("humanmm batch retry-failed --stage camera --wait", "what failed there, again"),),
    "batch report": (("humanmm batch report monday --out report", "report.html and report.csv"),),
    "bench": (
        ("humanmm bench ms-render --size tiny", "a first table in a few minutes"),
        ("humanmm bench speed --data film.mp4 --runs 3", "milliseconds a frame of every stage"),
    ),
    "verify": (("humanmm verify --deep", "decodes every result"),),
    "gc": (("humanmm gc --unused-days 90 --yes", "removes what no run has used for so long"),),
    "doctor": (("humanmm doctor", "names a cure for everything that is wrong"),),
}
"""Command → lines, each with what it does."""


def epilog(command: str) -> str | None:
    """The examples of a command as Typer shows them below the help; None if it has none."""
    lines = EXAMPLES.get(command, ())
    if not lines:
        return None
    return "\n\n".join(["[bold]Examples[/bold]", *(f"{line}  [dim]{about}[/dim]" for line, about in lines)])
