"""python -m aerotri.cli"""

from aerotri.cli import main

main()
