//! A table as CSV: a line of headings, then fields of text and numbers. A field in which a comma, a
//! quote or a line break stands is quoted; a number that is not there is an empty field.

/// A file under way.
pub(crate) struct Csv {
    text: String,
}

impl Csv {
    /// A file with this line of headings.
    pub(crate) fn new(head: &str) -> Self {
        Self {
            text: format!("{head}\n"),
        }
    }

    fn field(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push(',');
    }

    /// Adds fields of text.
    pub(crate) fn texts<const N: usize>(&mut self, texts: [&str; N]) {
        for text in texts {
            if text.contains([',', '"', '\n', '\r']) {
                self.field(&format!("\"{}\"", text.replace('"', "\"\"")));
            } else {
                self.field(text);
            }
        }
    }

    /// Adds a number, or an empty field.
    pub(crate) fn number(&mut self, value: Option<f64>) {
        self.field(&value.map_or_else(String::new, |value| value.to_string()));
    }

    /// Adds numbers, or as many empty fields.
    pub(crate) fn numbers<const N: usize>(&mut self, values: Option<[f64; N]>) {
        for place in 0..N {
            self.number(values.map(|values| values[place]));
        }
    }

    /// Ends the line, which has at least one field.
    pub(crate) fn end(&mut self) {
        self.text.pop();
        self.text.push('\n');
    }

    /// The file.
    pub(crate) fn text(self) -> String {
        self.text
    }
}
