"""`python -m app` is `teleop`."""

import sys

from app.cli import main

sys.exit(main())
