"""`humanmm doctor` prints what a run needs of this machine, and a cure for each thing that it lacks."""

from dataclasses import asdict

from humanmm.cli.terminal import write_all, write_json
from humanmm.cli.verb import STORE, Json, Store, app, verb


@verb(app, "doctor", panel=STORE)
def doctor(*, json: Json = False, store: Store = None) -> int:
    """Check this installation.

    Exit status 1 if a check fails; the line below it names the cure.
    """
    from humanmm.installation import checks
    from humanmm.storage.store.store import default_store

    found = list(checks(store or default_store()))
    ok = all(check.ok for check in found)
    if json:
        write_json({"ok": ok, "checks": [asdict(check) for check in found]})
        return 0 if ok else 1
    for check in found:
        write_all([f"{'ok ' if check.ok else 'BAD'}  {check.name:<24} {check.found}"])
        if not check.ok:
            write_all([f"     {'':<24} → {check.cure}"])
    return 0 if ok else 1
