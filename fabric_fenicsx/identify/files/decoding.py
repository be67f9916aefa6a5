"""The text of a file as people save it: UTF-8, UTF-16 or UTF-32, marked or not, Shift-JIS, EUC-JP, Latin."""

import codecs
import re
import unicodedata

from ...errors import InputError

MARKS = {
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
"""Byte order mark -> encoding; those of UTF-32 first, for they begin like those of UTF-16."""

# two kana or common kanji in a row: lead bytes that are no letters in any Latin encoding
JAPANESE = re.compile(rb"(?:[\x82-\x97][\x40-\x7e\x80-\xfc]){2}")
# the same of EUC-JP, where all bytes above 0x7f go in pairs
JAPANESE_EUC = re.compile(rb"(?:[\xa4\xa5][\xa1-\xf6]|[\xb0-\xf4][\xa1-\xfe]){2}")


def decode(raw: bytes, file: str) -> str:
    """The text of a file, in the compatibility form of Unicode (NFKC): full-width digits and hard spaces are plain.

    Raises InputError where the bytes are no text.
    """
    try:
        text = raw.decode(_encoding(raw)).replace("\ufeff", "")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError(f"{file}: is no plain text; export the test as CSV (UTF-8).")
    return unicodedata.normalize("NFKC", text)


def _encoding(raw: bytes) -> str:
    for mark, name in MARKS.items():
        if raw.startswith(mark):
            return name
    # without a mark: of the plain letters of a table every second byte is zero
    for first, name in (1, "utf-16-le"), (0, "utf-16-be"):
        if len(raw) > 7 and len(raw) % 2 == 0 and raw[first::2].count(0) > 0.7 * len(raw) / 2:
            return name
    if b"\x1b$" in raw:  # what turns to two bytes a letter
        return "iso2022_jp"
    proof = {"cp932": JAPANESE, "euc_jp": JAPANESE_EUC}
    for name in "utf-8", "cp932", "euc_jp", "cp1252":
        try:
            raw.decode(name)
        except UnicodeDecodeError:
            continue
        if name not in proof or proof[name].search(raw):
            return name
    return "latin-1"
