//! `selvedge-bindgen MODULE.wasm FOLDER` writes the module and the JavaScript around it into the folder.

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(module), Some(folder)) = (arguments.next(), arguments.next()) else {
        return Err("usage: selvedge-bindgen MODULE.wasm FOLDER".into());
    };
    let mut bindgen = wasm_bindgen_cli_support::Bindgen::new();
    bindgen.input_path(module).web(true)?.typescript(true);
    bindgen.omit_default_module_path(false).generate(folder)?;
    Ok(())
}
