"""A process under a name that no other ever has, and whether it lives."""

import os
import subprocess
import time
from dataclasses import replace

from humanmm.machine import started
from humanmm.storage.batches.owner import Owner


def test_this_process_lives_and_is_read_back_from_its_name() -> None:
    owner = Owner.this_process()
    assert owner.pid == os.getpid() and owner.is_alive()
    assert Owner.parse(str(owner)) == owner


def test_a_process_that_has_ended_does_not_live_also_before_it_is_waited_for() -> None:
    child = subprocess.Popen(["sleep", "60"])
    owner = replace(Owner.this_process(), pid=child.pid, started=started(child.pid) or 0)
    assert owner.is_alive()
    child.kill()
    deadline = time.monotonic() + 10
    while owner.is_alive():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    child.wait()
    assert owner.is_alive() is False


def test_another_process_with_the_same_id_is_not_the_owner() -> None:
    owner = Owner.this_process()
    assert replace(owner, started=owner.started - 1).is_alive() is False


def test_this_machine_cannot_tell_of_a_process_of_another_one_or_of_an_earlier_boot() -> None:
    assert replace(Owner.this_process(), machine="another").is_alive() is None
