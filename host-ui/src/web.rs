//! The window in a web page, over a core in the page or over a recording.
//!
//! A page has one thread: what the window gives to threads elsewhere is done at once.

use crate::app::{App, Home, Options};
use wasm_bindgen::{JsCast, JsValue};
use web_sys::{Document, HtmlCanvasElement};

/// Identifiers of the elements of `web/index.html`.
const CANVAS: &str = "window";
const WAITING: &str = "waiting";

/// Opens the window in the page's canvas, over the core that `home` connects to. A failure is shown in its place.
pub fn start(home: Home) {
    wasm_bindgen_futures::spawn_local(async move {
        let Some(document) = web_sys::window().and_then(|window| window.document()) else {
            return;
        };
        let opened = open(&document, home).await;
        let Some(waiting) = document.get_element_by_id(WAITING) else {
            return;
        };
        match opened {
            Ok(()) => waiting.remove(),
            Err(why) => {
                let why = why.as_string().unwrap_or_else(|| format!("{why:?}"));
                let text = format!("This browser cannot draw the window, which needs WebGL 2 or WebGPU: {why}");
                waiting.set_text_content(Some(&text));
            }
        }
    });
}

async fn open(document: &Document, home: Home) -> Result<(), JsValue> {
    let canvas = document.get_element_by_id(CANVAS).ok_or("the page has no canvas")?;
    let canvas: HtmlCanvasElement = canvas.dyn_into().map_err(|_| "the canvas is another element")?;
    let create: eframe::AppCreator<'static> =
        Box::new(move |cc| Ok(Box::new(App::with_home(cc, Options::default(), home))));
    let options = eframe::WebOptions::default();
    eframe::WebRunner::new().start(canvas, options, create).await
}
