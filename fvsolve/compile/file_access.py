"""Owners and access rights of files whose content runs as machine code."""

from __future__ import annotations

import os
import stat
from pathlib import Path

GROUP_WRITES, OTHERS_WRITE = stat.S_IWGRP, stat.S_IWOTH
REMEDY = "remove it (its content is compiled again), or let its owner run chmod -R go-w"
# False on Windows, whose folders of a user are closed to other users
CHECKED = hasattr(os, "geteuid")


def fault(path: Path) -> str:
    """Text about a folder or file in which another user can write, such as "is owned by bob"; "" if none can.

    Its owner must be this user or root. A group may write if it is the private group of this user, as on systems that
    give each user a group of the same name. A missing file has no fault.
    """
    if not CHECKED:
        return ""
    try:
        return fault_of(os.stat(path))
    except OSError:
        return ""


def fault_of(status: os.stat_result) -> str:
    """Text on the owner and rights in a result of `os.stat`; "" if no other user can write. See `fault`."""
    if not CHECKED:
        return ""
    if status.st_uid not in (0, os.geteuid()):
        return f"is owned by {user_name(status.st_uid)}"
    if status.st_mode & OTHERS_WRITE:
        return "can be written by all users"
    if status.st_mode & GROUP_WRITES and not is_private_group(status):
        return f"can be written by the group {group_name(status.st_gid)}"
    return ""


def is_private_group(status: os.stat_result) -> bool:
    """True if the group of a file is the group of the same name and number as this user, and has no other member."""
    import grp
    import pwd

    try:
        user, group = pwd.getpwuid(os.geteuid()), grp.getgrgid(status.st_gid)
    except KeyError:
        return False
    return (
        group.gr_gid == user.pw_gid
        and group.gr_name == user.pw_name
        and {*group.gr_mem} <= {user.pw_name}
    )


def user_name(number: int) -> str:
    """Name of a user, or its number if it has no name."""
    import pwd

    try:
        return pwd.getpwuid(number).pw_name
    except KeyError:
        return f"user {number}"


def group_name(number: int) -> str:
    """Name of a group, or its number if it has no name."""
    import grp

    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return str(number)


def read(path: Path) -> bytes | None:
    """Content of a file; None if it cannot be read, or if another user can write it."""
    try:
        with open(path, "rb") as file:
            return None if fault_of(os.fstat(file.fileno())) else file.read()
    except OSError:
        return None


def close_to_others(number: int) -> None:
    """Take the right to write an open file from all users but its owner; number : of the file, as from `fileno`."""
    if CHECKED:
        os.fchmod(number, stat.S_IMODE(os.fstat(number).st_mode) & ~(GROUP_WRITES | OTHERS_WRITE))
