"""What the charts of all commands share: matplotlib as it is set up, rows as they are read, pictures as they are saved."""
import csv
import sys

try:
    import matplotlib
except ModuleNotFoundError:
    sys.exit("the charts need matplotlib: apt install python3-matplotlib")

matplotlib.use("Agg")
matplotlib.rcParams["svg.hashsalt"] = "treelight"  # the same file for the same rows
matplotlib.rcParams["font.size"] = 9
from matplotlib import pyplot  # noqa: E402


def read(path, kind, numbers, texts=(), may_be_empty=False):
    """The rows of the CSV file of `kind`, "a bench": `numbers` as floats, or None where one is empty and may be.

    Ends the program, with the place, where a column is missing, a row is cut or a number is none.
    """
    try:
        with open(path, newline="") as file:
            reader = csv.DictReader(file)
            for column in (*numbers, *texts):
                if column not in (reader.fieldnames or []):
                    sys.exit(f"{path}:1: the columns are not those of {kind}: there is no {column}")
            rows = list(reader)
    except OSError as error:
        sys.exit(f"{path}: {error.strerror}")
    except (UnicodeDecodeError, csv.Error):
        sys.exit(f"{path}: it is no CSV file")
    for line, row in enumerate(rows, start=2):
        if None in row.values():
            sys.exit(f"{path}:{line}: the row has fewer values than there are columns; was the file cut off?")
        for column in numbers:
            try:
                row[column] = None if may_be_empty and not row[column] else float(row[column])
            except (TypeError, ValueError):
                sys.exit(f"{path}:{line}: {column} is {row[column]!r}, no number")
    return rows


def unique(values):
    """Each value once, in the order in which they came."""
    return list(dict.fromkeys(values))


def save(figure, folder, name, rect=(0, 0, 1, 1)):
    """Writes FOLDER/NAME.png and .svg; `rect` is what the panels may fill."""
    figure.tight_layout(rect=rect)
    figure.savefig(f"{folder}/{name}.png", dpi=130, metadata={"Software": None})
    figure.savefig(f"{folder}/{name}.svg", metadata={"Date": None, "Creator": None})
    pyplot.close(figure)
