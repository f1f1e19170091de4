"""A process under a name that no other ever has, and whether it lives."""

import os
import subprocess
import time
from dataclasses import replace

from humanmm.storage.batches.owner import Owner, process_age_s


def test_this_process_lives_and_is_read_back_from_its_name() -> None:
    owner = Owner.this_process()
    assert owner.pid == os.getpid() and owner.is_alive()
    assert Owner.parse(str(owner)) == owner


def test_a_process_that_has_ended_does_not_live_also_before_it_is_waited_for() -> None:
    child = subprocess.Popen(["sleep", "60"])
    owner = replace(Owner.this_process(), pid=child.pid, started=_started(child.pid))
    assert owner.is_alive()
    child.kill()
    deadline = time.monotonic() + 10
    while owner.is_alive():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    child.wait()
    assert owner.is_alive() is False and process_age_s(child.pid) is None


def test_another_process_with_the_same_id_is_not_the_owner() -> None:
    owner = Owner.this_process()
    assert replace(owner, started=owner.started - 1).is_alive() is False


def test_this_machine_cannot_tell_of_a_process_of_another_one_or_of_an_earlier_boot() -> None:
    assert replace(Owner.this_process(), machine="another").is_alive() is None


def test_the_age_of_a_process_grows_with_time() -> None:
    before = process_age_s(os.getpid()) or 0.0
    time.sleep(0.2)
    after = process_age_s(os.getpid()) or 0.0
    assert before > 0 and 0.1 < after - before < 5


def _started(pid: int) -> int:
    from humanmm.storage.batches import owner

    return owner._started(pid) or 0
