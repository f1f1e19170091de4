"""The fork server imports this module before it forks, and with it all that the process of a video needs."""

from humanmm.flows.service.fork_server import Preloaded

PRELOADED = Preloaded()
