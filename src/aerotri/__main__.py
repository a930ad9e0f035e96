"""python -m aerotri"""

from aerotri.cli import main

main()
