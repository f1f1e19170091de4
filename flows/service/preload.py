"""What the fork server loads before it forks: it imports this module, and with it all that the process of a video needs."""

from humanmm.flows.service.fork_server import Preloaded

PRELOADED = Preloaded()
