"""Krita: sends the active layer to ObjectMorpher and brings its layers back as a group."""

import tempfile
from contextlib import contextmanager
from pathlib import Path

from krita import Extension, InfoObject, Krita
from PyQt5.QtCore import QProcess, QProcessEnvironment, QRect
from PyQt5.QtWidgets import QMessageBox

from . import door

GROUP = "ObjectMorpher"


@contextmanager
def quietly():
    """No dialog asks anything inside."""
    application = Krita.instance()
    before = application.batchmode()
    application.setBatchmode(True)
    try:
        yield
    finally:
        application.setBatchmode(before)


def send(document, node, path):
    """Writes a layer, as large as the document, into a PNG file."""
    everything = QRect(0, 0, document.width(), document.height())
    resolution = document.xRes(), document.yRes()
    with quietly():
        node.save(str(path), *resolution, InfoObject(), everything)


def bring_back(document, node, path):
    """Puts the layers of an OpenRaster file into a group above a layer; the group."""
    with quietly():
        source = Krita.instance().openDocument(str(path))
    source.setColorSpace(document.colorModel(), document.colorDepth(), document.colorProfile())
    group = document.createGroupLayer(GROUP)
    (node.parentNode() or document.rootNode()).addChildNode(group, node)
    for layer in source.topLevelNodes():
        box = layer.bounds()
        place = box.x(), box.y(), box.width(), box.height()
        copied = document.createNode(layer.name(), "paintlayer")
        group.addChildNode(copied, None)
        copied.setPixelData(layer.pixelData(*place), *place)
        copied.setVisible(layer.visible())
        copied.setBlendingMode(layer.blendingMode())
    source.close()
    document.refreshProjection()
    return group


class ObjectMorpher(Extension):
    """One entry in the menu Tools, Scripts."""

    def __init__(self, parent):
        super().__init__(parent)
        self._processes = []

    def setup(self):
        """Nothing has to be made ready."""

    def createActions(self, window):  # Krita's name for it
        action = window.createAction(
            "objectmorpher", "Edit in 3D with ObjectMorpher", "tools/scripts"
        )
        action.triggered.connect(self.edit)

    def edit(self):
        """Opens the window on the active layer; Krita goes on meanwhile."""
        document = Krita.instance().activeDocument()
        node = document.activeNode() if document is not None else None
        if node is None:
            return self._say("Open a picture and choose a layer first.")
        folder = tempfile.TemporaryDirectory()
        picture, back = (Path(folder.name) / name for name in ("layer.png", "back.ora"))
        send(document, node, picture)
        if not picture.exists():
            return self._say("The layer could not be saved.")
        first, *rest = door.command(picture, back)
        process = QProcess()
        own = QProcessEnvironment()
        for name, value in door.environment().items():
            own.insert(name, value)
        process.setProcessEnvironment(own)
        process.finished.connect(
            lambda code, _: self._finish(code, process, folder, document, node, back)
        )
        process.errorOccurred.connect(lambda *_: self._say(f"{first} could not be started."))
        self._processes.append(process)
        process.start(first, rest)

    def _finish(self, code, process, folder, document, node, back):
        self._processes.remove(process)
        if back.exists():
            bring_back(document, node, back)
        elif code != 0:
            said = bytes(process.readAllStandardError()).decode(errors="replace").splitlines()
            self._say(said[-1] if said else "ObjectMorpher ended without a word.")
        folder.cleanup()

    def _say(self, text):
        QMessageBox.information(None, "ObjectMorpher", text)


if Krita.instance() is not None:
    Krita.instance().addExtension(ObjectMorpher(Krita.instance()))
