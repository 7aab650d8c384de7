# SPDX-License-Identifier: MIT
"""python -m okid.report"""

import sys

from okid.report import main

if __name__ == "__main__":
    sys.exit(main())
