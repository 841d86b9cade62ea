"""Makes the stand-ins of this folder importable, in spawned processes too."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
