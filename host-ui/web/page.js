// Starts the window, and says so when it stops.
import init from "./stylet.js";

function say(text) {
  const line = document.getElementById("waiting") ?? document.querySelector("main").appendChild(document.createElement("p"));
  line.id = "waiting";
  line.textContent = text;
}

// A panic ends the program; its words are in the console.
window.addEventListener("error", () => say("The window has stopped. Reload the page to start it again."));

init({ module_or_path: "stylet.wasm" }).catch((why) => say(`The window cannot be loaded: ${why}`));
