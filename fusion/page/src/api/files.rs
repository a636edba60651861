//! The built page, within the binary.

use super::Refusal;
use axum::extract::Request;
use axum::http::{Method, StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use rust_embed::Embed;

/// What `scripts/page` has built; nothing after a build without Node.
#[derive(Embed)]
#[folder = "web/dist"]
#[allow_missing = true]
struct Built;

const NOT_BUILT: &str = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">\
<meta name=\"viewport\" content=\"width=device-width\"><title>Tennis court</title>\
<h1>The page is not built in</h1><p>This program was built without it. To build it: install \
Node 20.19 or newer, run <code>scripts/page</code>, then \
<code>cargo build --release --workspace</code> \
again.</p><p>What it would show is there all the same: \
<a href=\"/api/v1/openapi.json\">/api/v1/openapi.json</a>.</p></html>";

/// A file of the page; the page itself where there is no dot, for its own addresses.
pub(super) async fn page(request: Request) -> Response {
    if request.method() != Method::GET && request.method() != Method::HEAD {
        let error = "files can only be read";
        return Refusal::new(StatusCode::METHOD_NOT_ALLOWED, error).into_response();
    }
    let path = request.uri().path().trim_start_matches('/');
    let path = if path.is_empty() { "index.html" } else { path };
    match Built::get(path) {
        Some(file) => {
            // Names of assets carry a hash of what is in them.
            let is_hashed = path.starts_with("assets/");
            let cache = if is_hashed { "public, max-age=31536000, immutable" } else { "no-cache" };
            let headers = [
                (header::CONTENT_TYPE, file.metadata.mimetype().to_owned()),
                (header::CACHE_CONTROL, cache.to_owned()),
            ];
            (headers, file.data).into_response()
        }
        None if path == "index.html" => Html(NOT_BUILT).into_response(),
        None => Refusal::nothing("there is no such file").into_response(),
    }
}
