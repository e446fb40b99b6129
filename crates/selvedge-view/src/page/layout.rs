//! The layout of a page: a title, the keys of the colours, and tiles in rows and columns.

use crate::image::check_size;
use crate::page::colour_bar::{colour_bar_height, colour_bar_width, draw_colour_bar};
use crate::text::{Align, TextStyle, draw_text, text_width};
use crate::{Image, Panel, Rgb, ScalarField, ViewError};

const PAPER: Rgb = [255, 255, 255];
const TITLE_INK: Rgb = [30, 36, 50];
const LABEL_INK: Rgb = [44, 50, 64];
const CAPTION_INK: Rgb = [104, 110, 122];

/// The places of the tiles of a page.
#[derive(Clone, Debug)]
pub(crate) struct Page<'a> {
    title: &'a str,
    fields: Vec<&'a ScalarField>,
    tile: [u32; 2],
    grid: [u32; 2],
    /// Height of the strip above every row, in which labels stand; 0 without labels.
    strip: u32,
    /// Height of captions `[pixels]`.
    caption: f32,
}

impl<'a> Page<'a> {
    /// A page of `grid` (columns, rows) tiles of `tile` (width, height) `[pixels]`.
    pub(crate) fn new(
        title: &'a str,
        panels: &[Panel<'a>],
        tile: [u32; 2],
        grid: [u32; 2],
    ) -> Result<Self, ViewError> {
        check_size("tile", tile)?;
        let mut fields: Vec<&ScalarField> = Vec::new();
        for field in panels.iter().filter_map(|panel| panel.field) {
            if !fields.iter().any(|known| std::ptr::eq(*known, field)) {
                fields.push(field);
            }
        }
        let shorter = tile[0].min(tile[1]) as f32;
        let caption = (shorter / 30.0).clamp(7.0, 18.0).round();
        // A lone panel has the title for its label.
        let labelled = panels.len() > 1 && panels.iter().any(|panel| !panel.label.is_empty());
        let page = Self {
            title,
            fields,
            tile,
            grid,
            strip: if labelled { (2.3 * caption) as u32 } else { 0 },
            caption,
        };
        // 64-bit: a page of many large tiles must be refused, not wrapped around.
        let size = page
            .size()
            .map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        check_size("page", size)?;
        Ok(page)
    }

    /// An empty page: paper, title and keys.
    pub(crate) fn draw(&self) -> Result<Image, ViewError> {
        let [width, height] = self.size();
        let mut image = Image::filled(width as u32, height as u32, PAPER)?;
        let margin = self.margin();
        let mut top = margin;
        if !self.title.is_empty() {
            let style = self.style(self.title_height(), TITLE_INK);
            let base = top as f32 + self.title_height();
            draw_text(&mut image, self.title, [margin as f32, base], &style);
            if !self.keys_beside_title() {
                top += self.title_line();
            }
        }
        let mut left = if self.keys_beside_title() {
            width as u32 - margin - self.keys_width()
        } else {
            margin
        };
        for field in &self.fields {
            draw_colour_bar(&mut image, field, [left, top], self.caption);
            left += colour_bar_width(field, self.caption) + 2 * margin;
        }
        Ok(image)
    }

    /// The top left corner of a tile.
    pub(crate) fn place(&self, column: u32, row: u32) -> [u32; 2] {
        let gap = self.gap();
        [
            self.margin() + column * (self.tile[0] + gap),
            self.margin() + self.header() + row * (self.strip + self.tile[1] + gap) + self.strip,
        ]
    }

    /// Puts a picture on its tile, with a label above it (may be empty) and a caption in its lower
    /// left corner.
    pub(crate) fn put(
        &self,
        page: &mut Image,
        place: [u32; 2],
        picture: &Image,
        label: &str,
        caption: &str,
    ) {
        page.paste(picture, place);
        let [left, top] = place.map(|side| side as f32);
        let inset = 1.1 * self.caption;
        let style = self.style(1.05 * self.caption, LABEL_INK);
        let base = top - 0.6 * self.caption;
        if self.strip > 0 {
            draw_text(page, label, [left, base], &style);
        }
        let style = self.style(0.9 * self.caption, CAPTION_INK);
        let base = top + self.tile[1] as f32 - inset;
        draw_text(page, caption, [left + inset, base], &style);
    }

    fn style(&self, height: f32, colour: Rgb) -> TextStyle {
        TextStyle {
            height,
            colour,
            align: Align::Left,
        }
    }

    fn size(&self) -> [u64; 2] {
        let header = u64::from(self.header());
        [self.extent(0), self.extent(1) + header]
    }

    /// Width (0) or height (1) of the tiles with the gaps between and the margins around them.
    fn extent(&self, axis: usize) -> u64 {
        let strip = [0, self.strip][axis];
        let [count, side] = [self.grid[axis], strip + self.tile[axis]].map(u64::from);
        let gaps = count.saturating_sub(1) * u64::from(self.gap());
        2 * u64::from(self.margin()) + count * side + gaps
    }

    fn margin(&self) -> u32 {
        (1.8 * self.caption) as u32
    }

    fn gap(&self) -> u32 {
        (0.7 * self.caption) as u32
    }

    fn title_height(&self) -> f32 {
        1.45 * self.caption
    }

    /// From the top of the title to the top of what follows.
    fn title_line(&self) -> u32 {
        self.title_height() as u32 + self.margin()
    }

    fn keys_width(&self) -> u32 {
        let widths = self
            .fields
            .iter()
            .map(|f| colour_bar_width(f, self.caption));
        widths.sum::<u32>() + (self.fields.len() as u32).saturating_sub(1) * 2 * self.margin()
    }

    fn keys_beside_title(&self) -> bool {
        let title = text_width(self.title, self.title_height()) as u64;
        let both = title + u64::from(self.keys_width() + 4 * self.margin());
        !self.title.is_empty() && both <= self.extent(0)
    }

    /// Height of everything above the tiles.
    fn header(&self) -> u32 {
        let title = if self.title.is_empty() { 0 } else { self.title_line() };
        let keys = if self.fields.is_empty() {
            0
        } else {
            colour_bar_height(self.caption) + self.margin() / 2
        };
        if self.keys_beside_title() { title.max(keys) } else { title + keys }
    }
}
