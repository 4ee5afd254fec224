# SPDX-License-Identifier: MIT
"""Nothing received is evaluated or used as a path, and YAML is read safely: sources are scanned."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    p for pattern in ("src/*/src/**/*.py", "src/*/cfg/*.cfg") for p in sorted(ROOT.glob(pattern))
]
SAFE_LOADERS = {"yaml.SafeLoader", "yaml.CSafeLoader"}
FORBIDDEN = {"eval", "exec", "compile", "__import__", "os.system", "os.popen"}
FORBIDDEN_MODULES = {"pickle", "marshal", "shelve", "dill", "cPickle"}
OPENS = {"open", "Path", "load_yaml", "load_scenario", "scenario_path", "load_vehicle"}
HEARD = {"message", "msg", "m", "goal", "request", "req"}  # names of what ROS hands over
JUDGED = {"nmpc_control.ros.trajectory_action"}  # takes a name, refuses what could be a path


def dotted(node):
    if isinstance(node, ast.Name):
        return node.id
    return f"{dotted(node.value)}.{node.attr}" if isinstance(node, ast.Attribute) else ""


def findings(tree, module=""):
    """Return what a source must not do, a line each."""
    found, safe = [], set(SAFE_LOADERS)
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and {dotted(base) for base in node.bases} & SAFE_LOADERS:
            safe.add(node.name)  # the source's own, which adds to a safe one
    for node in ast.walk(tree):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = {a.name.split(".")[0] for a in node.names} | {getattr(node, "module", "") or ""}
            found += [f"{node.lineno}: {n}" for n in names & FORBIDDEN_MODULES]
        if not isinstance(node, ast.Call):
            continue
        name = dotted(node.func)
        if name in FORBIDDEN:
            found.append(f"{node.lineno}: {name}")
        if name in ("yaml.unsafe_load", "yaml.full_load", "yaml.unsafe_load_all", "yaml.load_all"):
            found.append(f"{node.lineno}: {name}")
        if name == "yaml.load":
            loaders = {dotted(k.value) for k in node.keywords if k.arg == "Loader"}
            if not loaders or not loaders <= safe:
                found.append(f"{node.lineno}: yaml.load without a safe loader")
        if any(k.arg == "shell" and getattr(k.value, "value", None) for k in node.keywords):
            found.append(f"{node.lineno}: shell=True")
        if ".ros." in f".{module}." and module not in JUDGED and name.split(".")[-1] in OPENS:
            arguments = [*node.args, *[k.value for k in node.keywords]]
            heard = {dotted(a).split(".")[0] for arg in arguments for a in ast.walk(arg)} & HEARD
            found += [f"{node.lineno}: {name} of {h}" for h in sorted(heard)]
    return found


def module_of(path):
    parts = path.with_suffix("").parts
    return ".".join(parts[len(parts) - parts[::-1].index("src") :]) if "src" in parts else ""


def test_sources_are_found():
    assert len(SOURCES) > 200
    assert "nmpc_control.ros.guard_node" in {module_of(path) for path in SOURCES}


def test_no_source_evaluates_or_opens_what_it_hears():
    found = []
    for path in SOURCES:
        tree = ast.parse(path.read_text(encoding="utf-8"), str(path))
        found += [f"{path.relative_to(ROOT)}:{f}" for f in findings(tree, module_of(path))]
    assert found == []


@pytest.mark.parametrize(
    "source",
    [
        "yaml.load(text)",
        "yaml.load(text, Loader=yaml.Loader)",
        "class Own(yaml.Loader):\n    pass\nyaml.load(text, Loader=Own)",
        "yaml.full_load(text)",
        "eval(text)",
        "exec(text)",
        "import pickle",
        "from pickle import loads",
        "subprocess.run(text, shell=True)",
        "open(message.data)",
        "load_scenario(goal.scenario)",
        "Path('x') / open(f'{m.data}.yaml')",
    ],
)
def test_the_scan_finds_it(source):
    assert findings(ast.parse(source), "nmpc_control.ros.some_node")


@pytest.mark.parametrize(
    "source",
    [
        "yaml.safe_load(text)",
        "yaml.load(t, Loader=yaml.SafeLoader)",
        "class Own(yaml.SafeLoader):\n    pass\nyaml.load(t, Loader=Own)",
    ],
)
def test_the_scan_lets_it_pass(source):
    assert not findings(ast.parse(source), "nmpc_control.ros.some_node")
