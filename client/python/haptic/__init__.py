"""The name that haptic_local_model had before version 0.4. Another project's package has it too; ours cannot be overwritten."""

import importlib
import importlib.abc
import importlib.machinery
import sys
import types
import warnings
from typing import Any

import haptic_local_model

warnings.warn("write `import haptic_local_model as haptic`: the package `haptic` of the Python index is another project's",
              DeprecationWarning, stacklevel=2)


class _SameModules(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """haptic.X is haptic_local_model.X, the very module."""

    def find_spec(self, name: str, path: Any, target: Any = None) -> "importlib.machinery.ModuleSpec | None":
        ours = name.startswith(__name__ + ".") and name != __name__ + ".__main__"  # `python3 -m haptic` runs the file.
        return importlib.machinery.ModuleSpec(name, self) if ours else None

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType:
        self._spec = importlib.import_module("haptic_local_model" + spec.name[len(__name__):]).__spec__
        return sys.modules["haptic_local_model" + spec.name[len(__name__):]]

    def exec_module(self, module: types.ModuleType) -> None:
        module.__spec__ = self._spec


sys.meta_path.insert(0, _SameModules())
sys.modules[__name__] = haptic_local_model
