"""What the package logs, by logging.getLogger("marble"): nothing is shown until the program configures logging.

Warnings: a server was lost, a session was opened again. Debug: each solution, and each further try of a call.
"""

from __future__ import annotations

import logging
from typing import Final

logger: Final = logging.getLogger("marble")
logger.addHandler(logging.NullHandler())
