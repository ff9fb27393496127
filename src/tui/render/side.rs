//! The panel beside the map: names of its panes, the selected pane, and more if there is room.

pub mod training;

use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

use super::{ScreenPainter, curves};
use crate::tui::action::Action;
use crate::tui::choices::Pane;
use crate::tui::layout::{Click, ClickableLine};
use crate::tui::pane_text::{EXPLAINED_WIDTH, explain, fitted_lines};
use crate::tui::scene::{Scene, legend};
use crate::tui::screen::Screen;
use crate::tui::theme::{BOLD, DIM, REVERSED};
use gdg::text::display_width;

/// Minimum rows below the chosen pane for another one, and for two.
const SECOND_PANE_ROWS: u16 = 10;
const THIRD_PANE_ROWS: u16 = 34;

const MIN_COLUMN_WIDTH: u16 = 36;

pub fn draw(page: &mut ScreenPainter, area: Rect) {
    let [head, body] = Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(area);
    tabs(page, head);
    if page.screen.maximised {
        return draw_pane(page, body, page.screen.pane);
    }
    let (chosen, screen, scene) = (page.screen.pane, page.screen, page.scene);
    let others = Pane::ALL.into_iter().filter(|pane| *pane != chosen);
    let mut panes: Vec<Pane> = std::iter::once(chosen).chain(others).collect();
    let needed = |pane: &Pane| lines(*pane, screen, scene, body.width).map(|own| own.len() + 1);
    let taken = needed(&chosen).unwrap_or(SECOND_PANE_ROWS.into());
    let rows = match body.height.saturating_sub(taken as u16) {
        left if left >= THIRD_PANE_ROWS => 3,
        left if left >= SECOND_PANE_ROWS => 2,
        _ => 1,
    };
    // No more columns than there are panes for: the others are wider.
    let most = panes.len().div_ceil(rows);
    let columns = usize::from(body.width / MIN_COLUMN_WIDTH).clamp(1, most);
    // Charts get a column of their own if one has room for all that is text.
    let text = || panes.iter().filter_map(needed).sum::<usize>();
    let stacks: Vec<&[Pane]> = if columns > 1 && text() <= body.height.into() {
        panes.sort_by_key(|pane| *pane == Pane::Curves && chosen != Pane::Curves);
        panes.chunk_by(|a, b| [a, b].iter().all(|pane| **pane != Pane::Curves)).collect()
    } else {
        panes.chunks(rows).take(columns).collect()
    };
    let areas = Layout::horizontal(vec![Constraint::Fill(1); stacks.len()]).split(body);
    for (panes, area) in stacks.into_iter().zip(areas.iter()) {
        for (pane, area) in panes.iter().zip(stack(*area, panes, screen, scene)) {
            draw_pane(page, area, *pane);
        }
    }
}

/// Returns the areas of panes: text takes what it needs, curves the rest.
fn stack(area: Rect, panes: &[Pane], screen: &Screen, scene: &Scene) -> Vec<Rect> {
    let mut left = area.height;
    let height = |pane: &Pane| match lines(*pane, screen, scene, area.width.saturating_sub(1)) {
        Some(lines) if panes.len() > 1 => {
            let rows = (lines.len() as u16 + 1).min(left);
            left -= rows;
            Constraint::Length(rows)
        }
        _ => Constraint::Fill(1),
    };
    Layout::vertical(panes.iter().map(height)).split(area).to_vec()
}

/// Returns a pane's lines for `width` columns, if it consists of lines.
pub fn lines(pane: Pane, screen: &Screen, scene: &Scene, width: u16) -> Option<Vec<Line<'static>>> {
    match pane {
        Pane::Training => Some(training::lines(screen, scene, width.into(), screen.maximised)),
        Pane::Walk => {
            let mut lines = legend::walk_lines(&**scene, screen);
            if usize::from(width) >= EXPLAINED_WIDTH {
                lines.iter_mut().for_each(|line| explain(line, legend::MEANINGS));
            }
            Some(lines)
        }
        Pane::Legend => Some(legend::lines(&**scene, screen)),
        Pane::Curves => None,
    }
}

fn draw_pane(page: &mut ScreenPainter, area: Rect, pane: Pane) {
    let ScreenPainter { frame, screen, scene, .. } = page;
    let (screen, scene) = (*screen, *scene);
    let style = if pane == screen.pane { BOLD } else { Style::new() };
    let mut block = Block::new()
        .borders(Borders::TOP | Borders::LEFT)
        .title(Span::styled(format!(" {} ", pane.name()), style));
    let has_more =
        matches!(pane, Pane::Training | Pane::Walk) && !screen.maximised && pane == screen.pane;
    if has_more && usize::from(area.width) <= EXPLAINED_WIDTH {
        let key = screen.keymap.key_of(Action::Maximise);
        block = block.title(Line::styled(format!(" {key} more "), DIM).right_aligned());
    }
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let mut clicks = Vec::new();
    match lines(pane, screen, scene, inner.width) {
        None => curves::draw(page, inner),
        Some(lines) => {
            let rows = inner.rows().zip(&lines);
            let click = |(row, line): (Rect, &Line)| {
                let asks = pane == Pane::Training && line.to_string().starts_with(" evaluation ");
                asks.then_some((row, Action::Evaluate))
            };
            clicks.extend(rows.filter_map(click));
            frame.render_widget(Paragraph::new(fitted_lines(lines, inner.width)), inner);
        }
    }
    if pane == Pane::Legend {
        let rows = inner.rows().skip(legend::FIRST_OVERLAY).zip(legend::overlays(&**scene, screen));
        clicks.extend(rows.map(|(row, overlay)| (row, Action::Toggle(overlay))));
    }
    clicks.push((Rect { height: 1, ..area }, Action::Show(pane)));
    clicks.into_iter().for_each(|(row, action)| page.layout.add(row, Click::Act(action)));
}

/// Draws the names of the panes with their keys: where room is short, only the names, or only the
/// keys of those that are not selected.
fn tabs(page: &mut ScreenPainter, area: Rect) {
    let ScreenPainter { frame, screen, scene, layout } = page;
    let key = |pane| screen.keymap.key_of(Action::Show(pane));
    let all = Pane::ALL.map(|pane| format!(" {} {} ", key(pane), pane.name()));
    let names = Pane::ALL.map(|pane| format!(" {} ", pane.name()));
    let keys = Pane::ALL.map(|pane| match &all[pane as usize] {
        chosen if pane == screen.pane => chosen.clone(),
        _ => format!(" {} ", key(pane)),
    });
    // The trailing blank may be cut off.
    let fits = |texts: &[String]| display_width(&texts.concat()) <= usize::from(area.width) + 1;
    // The editor uses these keys itself.
    let texts = match scene.is_editing() {
        false if fits(&all) => all,
        false if !fits(&names) => keys,
        _ => names,
    };
    let mut bar = ClickableLine::default();
    for (pane, text) in Pane::ALL.into_iter().zip(texts) {
        bar.push(
            Span::styled(text, if pane == screen.pane { REVERSED } else { DIM }),
            Click::Act(Action::Show(pane)),
        );
    }
    bar.draw(frame, area, layout);
}
