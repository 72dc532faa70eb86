"""`python -m jaxsfs.cli` for `jaxsfs`."""

import sys

from jaxsfs.cli import main

sys.exit(main())
