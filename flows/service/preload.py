"""The fork server imports this module before it forks, and with it all that the process of a video needs."""

import humanmm.models.perception.lifting.lift  # noqa: F401 (torch, which takes two seconds to import)
from humanmm.flows.service.fork_server import Preloaded

PRELOADED = Preloaded()
