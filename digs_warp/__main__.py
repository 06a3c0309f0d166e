"""`python -m digs_warp` is `digs-warp`."""

import sys

from digs_warp.cli import main

sys.exit(main())
