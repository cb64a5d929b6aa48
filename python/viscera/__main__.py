"""`python -m viscera` is the `viscera` command."""

from viscera.cli import main

raise SystemExit(main())
