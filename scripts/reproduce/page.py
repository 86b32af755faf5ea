# SPDX-License-Identifier: BSD-3-Clause
"""What the pages of the papers share: numbers out of reports, tables, pictures, the page itself.

A number that is promised and not found ends the program: no row stays empty in silence.
"""
import os
import re
import shutil
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
# What stands under 'here' where there is nothing, and only there.
NOT_REPRODUCED = "not reproduced"


def cells(line):
    """Of a row of a Markdown table."""
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


class Report:
    """What a program printed, or a part of it."""

    def __init__(self, path, text=None):
        self.path = path
        self.text = text
        if text is None:
            with open(path, encoding="utf-8") as file:
                self.text = file.read()

    def find(self, pattern):
        """The groups of the first match, as numbers where they are some."""
        match = re.search(pattern, self.text, re.M)
        if not match:
            sys.exit(f"error: nothing like '{pattern}' in {self.path}")
        return [number(group) for group in match.groups()]

    def value(self, pattern):
        """The first group."""
        return self.find(pattern)[0]

    def part(self, begin, end=r"\Z"):
        """What stands between the first match of one pattern and the next one of the other."""
        match = re.search(rf"(?:{begin})((?s:.)*?)(?:{end})", self.text, re.M)
        if not match:
            sys.exit(f"error: nothing between '{begin}' and '{end}' in {self.path}")
        return Report(self.path, match.group(1))

    def table(self, heading):
        """The Markdown table whose first column has this heading: its rows as lists of cells."""
        lines = self.text.split("\n")
        for k, line in enumerate(lines):
            if line.startswith("|") and cells(line)[0] == heading:
                rows = []
                for row in lines[k + 2:]:
                    if not row.startswith("|"):
                        break
                    rows.append(cells(row))
                return rows
        sys.exit(f"error: no table '{heading}' in {self.path}")


def number(text):
    """A float where it is one."""
    try:
        return float(text)
    except ValueError:
        return text


def off(here, paper):
    """By how much: in per cent, beyond a factor of 1.5 as the factor."""
    if here == paper:
        return "equal"
    ratio = here / paper
    if ratio > 1.5 or ratio < 1 / 1.5:
        return f"× {ratio:.2g}"
    return f"{100 * (ratio - 1):+.0f} %"


def compare(where, what, paper, here, unit="", why="", digits=2):
    """A row with a number on both sides."""
    unit = " " + unit if unit else ""
    return [where, what, f"{paper:g}{unit}", f"{here:.{digits}f}{unit}", off(here, paper), why]


class Page:
    """Markdown in `folder`; pictures go to images/ beside it, as those of the docs."""

    def __init__(self, title, source, command, about):
        self.parts = [f"# {title}\n\n{source}\n\nThis page is written by\n\n"
                      f"```sh\n{command}\n```\n\n{about}"]
        self.pictures = {}

    def text(self, text):
        """A paragraph or a heading."""
        self.parts.append(text)

    def table(self, columns, rows):
        """Every row has as many cells as there are columns."""
        lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        for row in rows:
            if len(row) != len(columns):
                sys.exit(f"error: a row of {len(row)} cells for {len(columns)} columns: {row}")
            lines.append("| " + " | ".join(row) + " |")
        self.parts.append("\n".join(lines))

    def figures(self, rows):
        """Figure, what it shows, what there is here, why it differs or is not there."""
        self.table(["figure", "the paper shows", "here", "why it differs, or is not there"], rows)

    def numbers(self, rows):
        """As `compare` makes them."""
        self.table(["where", "what", "paper", "here", "off", "why"], rows)

    def picture(self, name, source, caption):
        """`name`: of the file in images/, as in the docs. `source`: where the program drew it."""
        if not os.path.isfile(source):
            sys.exit(f"error: there is no picture {source}")
        self.pictures[name] = source
        self.parts.append(f"![{caption}](images/{name}.png)")

    def write(self, name, folder):
        """In docs/ pictures that are there already stay; elsewhere links lead to docs/."""
        docs = os.path.join(ROOT, "docs")
        in_docs = os.path.realpath(folder) == os.path.realpath(docs)
        images = os.path.join(folder, "images")
        os.makedirs(images, exist_ok=True)
        for picture, source in self.pictures.items():
            target = os.path.join(images, picture + ".png")
            if not (in_docs and os.path.isfile(target)):
                shutil.copyfile(source, target)
        text = "\n\n".join(self.parts) + "\n"
        for link in re.findall(r"\]\(([a-z_0-9]+\.md)", text):
            if not os.path.isfile(os.path.join(docs, link)):
                sys.exit(f"error: a link to docs/{link}, which is not there")
        if not in_docs:
            up = os.path.relpath(docs, folder)
            text = re.sub(r"\]\(([a-z_0-9]+\.md)", rf"]({up}/\1", text)
        with open(os.path.join(folder, name + ".md"), "w", encoding="utf-8") as file:
            file.write(text)


def arguments():
    """The folder with what the programs wrote, and that of the page."""
    if len(sys.argv) != 3:
        sys.exit(f"usage: {sys.argv[0]} <folder of the runs> <folder of the page>")
    return sys.argv[1], sys.argv[2]
