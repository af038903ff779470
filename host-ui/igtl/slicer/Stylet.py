"""Module of 3D Slicer: shows needle, seeds, gland and ultrasound of a running simulator with one click (docs/slicer.md)."""

import qt
import slicer
from slicer.ScriptedLoadableModule import ScriptedLoadableModule, ScriptedLoadableModuleWidget
from StyletLib.link import Link
from StyletLib.nodes import Nodes

SERVER = "localhost:18944"
PERIOD_MS = 33


class Stylet(ScriptedLoadableModule):
    def __init__(self, parent):
        super().__init__(parent)
        parent.title = "Stylet"
        parent.categories = ["IGT"]
        parent.contributors = ["Stylet"]
        parent.helpText = "Shows a simulated brachytherapy: needle, seeds, gland and ultrasound. Not a medical device."


class StyletWidget(ScriptedLoadableModuleWidget):
    def setup(self):
        super().setup()
        self.link = None
        self.server = qt.QLineEdit(SERVER)
        self.button = qt.QPushButton("Connect")
        self.words = qt.QLabel("Start rt-core and host-ui igtl, then connect.")
        self.words.setWordWrap(True)
        form = qt.QFormLayout()
        form.addRow("Server", self.server)
        form.addRow(self.button)
        form.addRow(self.words)
        self.layout.addLayout(form)
        self.layout.addStretch(1)
        self.timer = qt.QTimer()
        self.timer.setInterval(PERIOD_MS)
        self.timer.connect("timeout()", self.pass_on)
        self.button.connect("clicked()", self.toggle)

    def cleanup(self):
        if self.link:
            self.toggle()

    def toggle(self):
        """Connects, or ends the connection. Nodes stay, so they can be saved."""
        if self.link:
            self.timer.stop()
            self.link.close()
            self.link = None
            self.say("Disconnected.", True)
        else:
            host, _, port = self.server.text.rpartition(":")
            if not (host and port.isdecimal() and int(port) < 1 << 16):
                self.say(f"A server is HOST:PORT, such as {SERVER}.", False)
                return
            self.link, self.nodes, self.is_framed = Link(host, int(port)), Nodes(slicer.mrmlScene), False
            self.timer.start()
        self.button.setText("Disconnect" if self.link else "Connect")
        self.server.setEnabled(self.link is None)

    def pass_on(self):
        newest = self.link.poll()
        self.nodes.show(newest)
        self.say(self.link.words, self.link.is_live)
        if "Gland" in newest and not self.is_framed:
            self.is_framed = True
            slicer.util.resetThreeDViews()
            middle_mm = newest["Gland"][0].mean(axis=0)
            slicer.modules.markups.logic().JumpSlicesToLocation(*middle_mm, True)

    def say(self, words, is_good):
        self.words.setText(words)
        self.words.setStyleSheet("" if is_good else "color: #c05000")
