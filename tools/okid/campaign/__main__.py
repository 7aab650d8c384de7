# SPDX-License-Identifier: MIT
"""python -m okid.campaign."""

import sys

from okid.campaign.command import main

if __name__ == "__main__":
    sys.exit(main())
