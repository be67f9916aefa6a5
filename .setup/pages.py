"""The documentation: theory, literate demos with what they print and draw, measured tables, and the code's own pages.

    python .setup/pages.py [--out out/docs] [--only NAME ...]

Markdown goes through markdown2, formulas through latex2mathml (a browser needs no script and no network), code through
Pygments, the package through pdoc. A literate demo is a script in the percent format: its docstring, then cells
`# %% [markdown]` and `# %%`; it is run, and its pictures are those of this run.
"""

import argparse
import html
import re
import subprocess
import sys
from pathlib import Path

import latex2mathml.converter
import markdown2
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / ".readme"
MODULES = ("fabric_fenicsx", "fabric_fenicsx.scenes.reading", "fabric_fenicsx.identify.listing",
           "fabric_fenicsx.identify.files")  # fmt: skip
STYLE = """
body { font: 16px/1.55 system-ui, sans-serif; margin: 0 auto; max-width: 52rem; padding: 1rem; color: #222; }
nav { font-size: 0.9rem; border-bottom: 1px solid #ccc; padding-bottom: 0.5rem; } nav a { margin-right: 1rem; }
h1, h2, h3 { line-height: 1.25; } a { color: #06488c; }
pre { background: #f6f6f4; padding: 0.7rem; overflow-x: auto; font-size: 0.85rem; line-height: 1.4; }
code { font-size: 0.9em; } img { max-width: 100%; height: auto; }
.wide { display: block; overflow-x: auto; max-width: 100%; padding: 0.45rem 0; }
table { border-collapse: collapse; font-size: 0.92rem; } td, th { border: 1px solid #ccc; padding: 0.25rem 0.55rem; }
math { font-size: 1.08em; }
"""


def literate():
    """The demos that are pages: those in the percent format."""
    return [path for path in sorted((ROOT / "demos").glob("*.py")) if "\n# %% [markdown]\n" in path.read_text()]


def cells(text):
    """Kind ("markdown" or "code") and text of each cell of a script; its docstring is the first one."""
    docstring, _, rest = text.removeprefix('"""').partition('"""\n')
    yield "markdown", "# " + docstring.strip()
    for part in re.split(r"^# %%", rest, flags=re.M):
        head, _, body = part.partition("\n")
        if head.strip() == "[markdown]":
            yield "markdown", re.sub(r"^# ?", "", body, flags=re.M).strip()
        elif body.strip():
            yield "code", body.strip("\n")


def prose(text):
    """HTML of Markdown with formulas between dollar signs, outside of code."""
    formulas = []

    def keep(found):
        if found[1] is not None:  # code
            return found[0]
        block = found[2] is not None
        formula = latex2mathml.converter.convert(found[2] or found[3], display="block" if block else "inline")
        formulas.append(f'<span class="wide">{formula}</span>' if block else formula)
        return f"formula{len(formulas) - 1}here"

    text = re.sub(r"(```.*?```|`[^`\n]+`)|\$\$(.+?)\$\$|\$([^$\n]+)\$", keep, text, flags=re.S)
    page = str(markdown2.markdown(text, extras=["fenced-code-blocks", "tables", "header-ids"]))
    page = page.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    page = re.sub(r"formula(\d+)here", lambda found: formulas[int(found[1])], page)
    return re.sub(r'href="(?!https?:)([^"#]+)\.md(#[^"]*)?"', r'href="\1.html\2"', page)


def code(text):
    """HTML of Python."""
    return highlight(text, PythonLexer(), HtmlFormatter(nowrap=False))


def write(path, title, body, depth=0):
    """A page with the site's head."""
    up = "../" * depth
    links = (("index.html", "start"), ("fabric_fenicsx.html", "code"), ("changelog.html", "changes"))
    nav = "".join(f'<a href="{up}{target}">{name}</a>' for target, name in links)
    style = STYLE + HtmlFormatter().get_style_defs(".highlight")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n<style>{style}</style></head>\n'
        f"<body><nav>{nav}</nav>\n{body}\n</body></html>\n"
    )


def title_of(text):
    """The first heading or line."""
    return text.strip().splitlines()[0].lstrip("# ").rstrip(".")


def markdown_page(source, target):
    """A page from a Markdown file; its title."""
    text = source.read_text()
    for picture in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text):
        (target.parent / picture).parent.mkdir(parents=True, exist_ok=True)
        (target.parent / picture).write_bytes((source.parent / picture).read_bytes())
    write(target, title_of(text), prose(text))
    return title_of(text)


def demo_page(path, out):
    """Run a demo into the folder of its page; its title. Raises RuntimeError if its check fails."""
    folder = out / path.stem
    answer = subprocess.run(
        [sys.executable, str(path), "--out", str(folder)], capture_output=True, text=True, cwd=ROOT, check=False
    )
    if answer.returncode:
        raise RuntimeError(f"{path.name} ended with status {answer.returncode}:\n{answer.stdout}{answer.stderr}")
    text = path.read_text()
    body = "\n".join(prose(part) if kind == "markdown" else code(part) for kind, part in cells(text))
    said = answer.stdout.replace(str(folder), "its folder")
    body += f"<h2>What it prints</h2><pre>{html.escape(said)}</pre><p>The script: <code>demos/{path.name}</code></p>"
    write(folder / "index.html", path.stem, body, depth=1)
    return title_of(text.removeprefix('"""'))


def main():
    """Build the site."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "docs")
    parser.add_argument("--only", nargs="*", help="names of the demos that are run and shown; by default all")
    args = parser.parse_args()
    out = args.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    entries = {"Theory": [], "Demos to read and change": [], "Measured": []}
    for source in sorted((README / "theory").glob("*.md")):
        entries["Theory"].append((f"{source.stem}.html", markdown_page(source, out / f"{source.stem}.html")))
    for source in sorted(README.glob("*.md")):
        entries["Measured"].append((f"{source.stem}.html", markdown_page(source, out / f"{source.stem}.html")))
    for path in literate():
        if args.only is None or path.stem in args.only:
            print(f"running demos/{path.name}", flush=True)
            entries["Demos to read and change"].append((f"{path.stem}/index.html", demo_page(path, out)))
    body = "<h1>fabric_fenicsx</h1><p>Woven fabric as a thin shell with measured hysteresis, on FEniCSx.</p>"
    for head, links in entries.items():
        items = "".join(f'<li><a href="{target}">{html.escape(name)}</a></li>' for target, name in links)
        body += f"<h2>{head}</h2><ul>{items}</ul>"
    body += '<h2>Code</h2><ul><li><a href="fabric_fenicsx.html">the package, room by room</a></li></ul>'
    subprocess.run(
        [sys.executable, "-m", "pdoc", "--docformat", "markdown", "-o", str(out), *MODULES], check=True, cwd=ROOT
    )
    write(out / "index.html", "fabric_fenicsx", body)  # after pdoc, which writes one too
    print(f"see {out / 'index.html'}")


if __name__ == "__main__":
    main()
