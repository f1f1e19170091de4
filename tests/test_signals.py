"""Interruptions that wait until a library is done."""

import signal

import pytest

from humanmm.signals import held


def test_an_interruption_comes_at_the_end_of_the_block() -> None:
    handler, done = signal.getsignal(signal.SIGINT), []

    def interrupted() -> None:
        with held():
            signal.raise_signal(signal.SIGINT)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert done
    assert signal.getsignal(signal.SIGINT) is handler


def test_nothing_comes_where_nothing_came() -> None:
    with held():
        pass
