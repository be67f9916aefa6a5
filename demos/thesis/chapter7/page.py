"""The means of the page: HTML that stands alone and prints well, tables, figures, one colour a fabric."""

import base64
import html
import io

import numpy as np

STYLE = """
body { font: 15px/1.5 Georgia, "DejaVu Serif", serif; color: #222; max-width: 60em; margin: 2em auto;
  padding: 0 1.2em; }
h1, h2, h3, th, nav, figcaption, .settings { font-family: "Helvetica Neue", Arial, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7em; line-height: 1.2; } h2 { font-size: 1.25em; margin-top: 2.2em; border-top: 2px solid #222;
  padding-top: .4em; } h3 { font-size: 1.05em; margin-top: 1.6em; }
figure { margin: 1.2em 0; } figure img { max-width: 100%; } figcaption { font-size: .85em; color: #444; }
.row { display: flex; flex-wrap: wrap; gap: .5em 1%; } .row div { width: 32%; font-size: .8em; text-align: center; }
.row.two div { width: 49%; }
table { break-inside: avoid; border-collapse: collapse; margin: 1em 0; font-size: .85em; }
caption { text-align: left; font-weight: bold;
  padding-bottom: .3em; } th, td { text-align: left; vertical-align: top; padding: .15em .8em .15em 0;
  border-bottom: 1px solid #ccc; } thead th { border-bottom: 1.5px solid #222; } td.n { white-space: nowrap; }
blockquote { margin: .8em 0; padding: .1em 1em; border-left: 3px solid #bbb; color: #333; }
.settings { font-size: .85em; color: #444; } .failed { border: 2px solid #b00; padding: .5em 1em; }
nav a { text-decoration: none; } nav { font-size: .85em; column-width: 22em; }
@page { size: A4; margin: 16mm 14mm; }
@media print { body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  h2, h3, caption, .settings { break-after: avoid; } figure, tr, blockquote, .failed { break-inside: avoid; }
  a { color: inherit; }
  p { orphans: 3; widows: 3; } }
"""


def text(words):
    """Plain words, safe in HTML."""
    return html.escape(str(words), quote=False)


def p(*sentences, kind=None):
    """A paragraph of sentences; some may be None."""
    told = " ".join(text(sentence) for sentence in sentences if sentence)
    return f'<p class="{kind}">{told}</p>' if kind else f"<p>{told}</p>"


def settings(words):
    """What was run and how, in small print."""
    return p(words, kind="settings")


def quote(words):
    """What the thesis says."""
    return f"<blockquote>{text(words)}</blockquote>"


def table(caption, head, rows):
    """Rows of plain words under their heads."""
    heads = "".join(f"<th>{text(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td{_number(cell)}>{text(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><caption>{text(caption)}</caption><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"


def _number(cell):
    return ' class="n"' if str(cell)[:1] in "+-0123456789" and len(str(cell)) < 30 else ""


def drawn(figure, caption, *numbers):
    """A matplotlib figure as the counterpart of some figures of the thesis ("7-10", ...)."""
    import matplotlib

    data = io.BytesIO()
    # the same figure twice is the same text
    with matplotlib.rc_context({"svg.hashsalt": "thesis"}):
        figure.savefig(data, format="svg", metadata={"Date": None})
    source = f"data:image/svg+xml;base64,{base64.b64encode(data.getvalue()).decode()}"
    return _figure(f'<img alt="{text(caption)}" src="{source}">', caption, numbers)


def snapshots(shots, caption, *numbers):
    """Rows of pictures, two or three in each, name -> png as text; one that could not be drawn is named."""
    missing = [name for name, data in shots.items() if data is None]
    images = "".join(
        f'<div><img alt="{text(name)}" src="data:image/png;base64,{data}"><br>{text(name)}</div>'
        for name, data in shots.items()
        if data
    )
    note = f" (No picture could be drawn here of: {', '.join(missing)}.)" if missing else ""
    return _figure(f'<div class="row{" two" if len(shots) in (2, 4) else ""}">{images}</div>', caption + note, numbers)


def _figure(inside, caption, numbers):
    anchors = "".join(f'<span id="fig-{number}"></span>' for number in numbers)
    of = f"Counterpart of Figure{'s' if len(numbers) > 1 else ''} {', '.join(numbers)}. " if numbers else ""
    return f"<figure>{anchors}{inside}<figcaption>{text(of + caption)}</figcaption></figure>"


def percent(value, digits=1):
    """A difference in percent, with its sign; a zero has none."""
    if value is None or not np.isfinite(value):
        return "none"
    shown = f"{value:+.{digits}f}"
    return f"{0:.{digits}f} %" if float(shown) == 0 else f"{shown} %"


def joined(words):
    """a, b and c."""
    words = list(words)
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
