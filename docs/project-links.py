"""A preprocessor of mdBook: links that leave the book lead to the files of the project.

On a server of GitHub these are the files of the commit, elsewhere those of the checkout. In an
archive of a release, the folder that lies beside the book (`GUIDE_BESIDE`) is found there, and a
link to another file is its text where there is no server. Pictures become part of the page. A
chapter that includes a file of the project has its text, and links to this file lead to the
chapter. What the tests of the guide read as any part of a line, `{..}`, is an ellipsis for the
reader.
"""

import base64
import json
import os
import pathlib
import re
import sys


PROJECT = pathlib.Path(__file__).resolve().parent.parent
BESIDE = os.environ.get("GUIDE_BESIDE")


def place_of(path):
    """Where a link to a file of the project leads, or nothing where the reader does not have it."""
    server, name = os.environ.get("GITHUB_SERVER_URL"), os.environ.get("GITHUB_REPOSITORY")
    if BESIDE and path.startswith(f"{BESIDE}/"):
        # mdBook takes a README of Markdown for a page of its own, so the link leads to its folder.
        return f"../{path.removesuffix('README.md')}"
    if server and name:
        return f"{server}/{name}/blob/{os.environ.get('GITHUB_SHA', 'main')}/{path}"
    return None if BESIDE else f"{PROJECT.as_uri()}/{path}"


def link(match):
    text, path, anchor = match.groups(default="")
    place = place_of(path)
    return f"[{text}]({place}{anchor})" if place else text


def picture(match):
    text, path = match.groups()
    data = base64.b64encode((PROJECT / path).read_bytes()).decode()
    return f"![{text}](data:image/svg+xml;base64,{data})"


INCLUDED = {"suites/README.md": "notation.md", "reference-devices/README.md": "device-files.md"}


def included(match):
    """The text of a file, with its links as of a chapter."""
    path = pathlib.PurePosixPath(match[1])
    text = (PROJECT / path).read_text()
    to = lambda link: f"](../../{os.path.normpath(path.parent / link[1])}"
    return re.sub(r"\]\((?![a-z]+:|#)([^)#]+)", to, text)


def lead_out(items):
    for item in items:
        if chapter := isinstance(item, dict) and item.get("Chapter"):
            chapter["content"] = re.sub(
                r"\{\{#include \.\./\.\./([^}]+)\}\}", included, chapter["content"])
            for file, name in INCLUDED.items():
                chapter["content"] = chapter["content"].replace(f"](../../{file}", f"]({name}")
            text = re.sub(r"!\[([^\]]*)\]\(\.\./\.\./([^)#]+)\)", picture, chapter["content"])
            text = re.sub(r"\[([^\]]+)\]\(\.\./\.\./([^)#]+)(#[^)]*)?\)", link, text)
            chapter["content"] = text.replace("{..}", "…")
            lead_out(chapter["sub_items"])


if sys.argv[1:2] == ["supports"]:
    sys.exit(0 if sys.argv[2] == "html" else 1)
context, book = json.load(sys.stdin)
lead_out(book.get("sections") or book.get("items"))
json.dump(book, sys.stdout)
