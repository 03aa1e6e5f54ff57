"""``python -m persfs_cl``: the same as the command ``persfs-cl``."""

from persfs_cl.cli import main

if __name__ == "__main__":
    main()
