"""A Dockerfile, read strictly, and its last stage done by hand: each instruction on a plain tree instead of an image."""

import glob
import json
import re
import shlex
import shutil
from dataclasses import dataclass, field
from pathlib import Path

KNOWN = {"FROM", "WORKDIR", "COPY", "RUN", "USER", "EXPOSE", "STOPSIGNAL", "HEALTHCHECK", "ENTRYPOINT", "CMD"}


@dataclass
class Stage:
    base: str
    name: str
    instructions: list = field(default_factory=list)

    def last(self, word):
        found = [text for kind, text in self.instructions if kind == word]
        return found[-1] if found else None


def read(path):
    text = re.sub(r"^\s*#.*\n", "", path.read_text(), flags=re.M)
    stages = []
    for line in re.sub(r"\\\n", " ", text).splitlines():
        if not line.strip():
            continue
        word, rest = line.split(None, 1)
        assert word in KNOWN, f"unknown instruction {word}"
        if word == "FROM":
            parts = re.fullmatch(r"(\S+)(?:\s+AS\s+(\S+))?", rest.strip())
            stages.append(Stage(parts.group(1), parts.group(2) or ""))
        else:
            stages[-1].instructions.append((word, re.sub(r"\s+", " ", rest.strip())))
    return stages


def exec_form(text):
    words = json.loads(text)
    assert isinstance(words, list) and all(isinstance(word, str) for word in words)
    return words


def copy(tree, text, context, stages):
    """`stages`: folder of this machine that stands for a folder of another stage, by the stage's name."""
    words = shlex.split(text)
    source = context
    if words[0].startswith("--from="):
        source = stages[words.pop(0).removeprefix("--from=")]
    *patterns, target = words
    for pattern in patterns:
        files = [Path(name) for name in glob.glob(str(source / pattern.lstrip("/")))]
        assert files, f"COPY {pattern}: there is no such file"
        for file in files:
            place = tree.root / target.lstrip("/")
            if target.endswith("/"):
                place.mkdir(parents=True, exist_ok=True)
                place = place / file.name
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, place)


def build(tree, stage, context, stages):
    for word, text in stage.instructions:
        if word == "COPY":
            copy(tree, text, context, stages)
        elif word == "RUN":
            tree.run("sh", "-c", text)
