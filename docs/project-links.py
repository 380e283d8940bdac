"""A preprocessor of mdBook: links that leave the book lead to the files of the project.

On a server of GitHub these are the files of the commit, elsewhere those of the checkout. A chapter
that includes a file of the project has its text, and links to this file lead to the chapter. What
the tests of the guide read as any part of a line, `{..}`, is an ellipsis for the reader.
"""

import json
import os
import pathlib
import re
import sys


def project():
    server, name = os.environ.get("GITHUB_SERVER_URL"), os.environ.get("GITHUB_REPOSITORY")
    if server and name:
        return f"{server}/{name}/blob/{os.environ.get('GITHUB_SHA', 'main')}/"
    return pathlib.Path(__file__).resolve().parent.parent.as_uri() + "/"


INCLUDED = {"suites/README.md": "notation.md", "reference-devices/README.md": "device-files.md"}


def included(match):
    """The text of a file, with its links as of a chapter."""
    path = pathlib.PurePosixPath(match[1])
    text = (pathlib.Path(__file__).resolve().parent.parent / path).read_text()
    to = lambda link: f"](../../{os.path.normpath(path.parent / link[1])}"
    return re.sub(r"\]\((?![a-z]+:|#)([^)#]+)", to, text)


def lead_out(items, root):
    for item in items:
        if chapter := isinstance(item, dict) and item.get("Chapter"):
            chapter["content"] = re.sub(
                r"\{\{#include \.\./\.\./([^}]+)\}\}", included, chapter["content"])
            for file, name in INCLUDED.items():
                chapter["content"] = chapter["content"].replace(f"](../../{file}", f"]({name}")
            text = re.sub(r"(!\[[^\]]*\]\()\.\./\.\./([^)#]+)", rf"\1{root}\2?raw=true", chapter["content"])
            text = re.sub(r"(\]\()\.\./\.\./", rf"\1{root}", text)
            chapter["content"] = text.replace("{..}", "…")
            lead_out(chapter["sub_items"], root)


if sys.argv[1:2] == ["supports"]:
    sys.exit(0 if sys.argv[2] == "html" else 1)
context, book = json.load(sys.stdin)
lead_out(book.get("sections") or book.get("items"), project())
json.dump(book, sys.stdout)
