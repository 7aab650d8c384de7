# SPDX-License-Identifier: MIT
"""Where the records of a campaign may lie: this computer, and the remote file systems that run no code of a file.

fsspec knows more: `reference://` renders templates, `dir://` and chained URLs (`a::b`) open one file system through
another. A SPEC.toml may come from somebody else, so what is not listed here is refused before fsspec hears of it.
"""

from __future__ import annotations

from typing import Any

from okid._errors import InputError

_TEXT, _FLAG = "text", "true or false"
_S3 = {"anon": _FLAG, "profile": _TEXT, "endpoint_url": _TEXT, "requester_pays": _FLAG, "key": _TEXT, "secret": _TEXT,
       "token": _TEXT}  # fmt: skip
_GS = {"project": _TEXT, "token": ("anon", "cloud", "google_default"), "requester_pays": _FLAG}
_ABFS = {"account_name": _TEXT, "account_key": _TEXT, "sas_token": _TEXT, "anon": _FLAG}
REMOTE: dict[str, dict[str, Any]] = {"s3": _S3, "gs": _GS, "abfs": _ABFS, "http": {}, "https": {}}


def is_remote(url: str) -> bool:
    """Is it no path of this computer?"""
    return "://" in url


def _fits(value: Any, rule: Any) -> bool:
    if isinstance(rule, tuple):
        return value in rule
    return isinstance(value, bool) if rule == _FLAG else isinstance(value, str) and value != ""


def storage_fault(protocol: str, storage: dict[str, Any]) -> str:
    """What is wrong with the options of a remote file system; "" = nothing."""
    known = REMOTE[protocol]
    for key, value in storage.items():
        if key not in known:
            return f'"{key}" is no option of {protocol}://, expected one of: {", ".join(known) or "none"}'
        if not _fits(value, known[key]):
            rule = known[key]
            return f'"{key}": found {value!r}, expected {" or ".join(rule) if isinstance(rule, tuple) else rule}'
    return ""


def protocol_of(url: str) -> str:
    """The protocol of a URL. Raises InputError when it is none of REMOTE, or a chain of them."""
    protocol = url.partition("://")[0]
    if "::" in url:
        raise InputError("a chained URL (::), expected one file system")
    if protocol not in REMOTE:
        raise InputError(f"{protocol}:// is no file system for records, expected a path, {'://, '.join(REMOTE)}://")
    return protocol


def opened(url: str, storage: dict[str, Any]) -> Any:
    """The fsspec file system of a path or URL, with its options. InputError as protocol_of() and storage_fault()."""
    if not is_remote(url):
        from fsspec.implementations.local import LocalFileSystem

        return LocalFileSystem()
    import fsspec

    protocol = protocol_of(url)
    if fault := storage_fault(protocol, storage):
        raise InputError(f"storage: {fault}")
    return fsspec.filesystem(protocol, **storage)
