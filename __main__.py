"""`python -m throwplan`."""

import sys

from throwplan.planner.cli import main

sys.exit(main())
