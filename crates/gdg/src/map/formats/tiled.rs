//! Maps of Tiled (TMX) whose layers are in CSV.

use std::fmt::Write;

use roxmltree::{Document, Node};

use super::super::grid::Grid;
use super::super::text_file::{MapError, MapResult, TextFile, TextPosition};
use super::{CellMark, MapFormat, MarkRows, Source, rows_of};

pub const FORMAT: MapFormat = MapFormat {
    name: "tiled",
    about: "Tiled's TMX in CSV: tiles of layers called walls, or else of any layer",
    endings: &["tmx"],
    loses: "",
    besides: "tiles, other layers, objects and properties",
    is: |source| source.is_text(is_tiled),
    read,
    write: |grid, _| write(grid).into_bytes(),
};

const HELP: &str =
    "save it in Tiled as a map of fixed size, with Map > Map Properties > Tile Layer Format: CSV";

const WALLS: &str = "where a layer called walls has tiles there are walls; without such a layer, where any layer has tiles";

/// The most attributes of an element and namespaces of a file: Tiled writes far fewer, and the time
/// that the parser takes grows with their square.
const MOST_ATTRIBUTES: usize = 100;

/// Pixels of a written tile along each side.
const TILE: usize = 16;

fn is_tiled(text: &TextFile) -> bool {
    text.source.trim_start().starts_with('<')
        && text.source.contains("<map")
        && text.source.contains("<layer")
}

/// Creates an error about an element.
fn fault(text: &TextFile, node: Node, problem: impl Into<String>, help: &str) -> Box<MapError> {
    text.error_at(text.place_of(node.range().start), problem, help)
}

/// Refuses elements with too many attributes; comments have none.
fn check_attributes(text: &TextFile) -> MapResult<()> {
    let is_full = |tag: &&str| tag.matches('=').count() > MOST_ATTRIBUTES && !tag.starts_with('!');
    let full = text.source.split('<').find(is_full);
    let full = full.map(|tag| tag.as_ptr() as usize - text.source.as_ptr() as usize - 1);
    let namespace = text.source.match_indices("xmlns").nth(MOST_ATTRIBUTES).map(|(at, _)| at);
    full.or(namespace).map_or(Ok(()), |at| {
        let problem = format!("more than {MOST_ATTRIBUTES} attributes: this is no map of Tiled");
        Err(text.error_at(text.place_of(at), problem, HELP))
    })
}

fn read(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    check_attributes(text)?;
    let document = Document::parse(text.source).map_err(|error| {
        let at = error.pos();
        let place = TextPosition { line: at.row as usize - 1, column: at.col as usize - 1 };
        text.error_at(place, format!("this is not XML: {error}"), HELP)
    })?;
    let root = document.root_element();
    if let Some(orientation) = root.attribute("orientation").filter(|way| *way != "orthogonal") {
        let problem = format!("the map is {orientation}, not orthogonal");
        let help = "maps have square cells: Map > Map Properties > Orientation: Orthogonal";
        return Err(fault(text, root, problem, help));
    }
    let layers: Vec<Node> = root.descendants().filter(|node| node.has_tag_name("layer")).collect();
    let named: Vec<Node> = layers.iter().filter(|layer| is_wall(**layer)).copied().collect();
    let (width, height) = (size(text, root, "width")?, size(text, root, "height")?);
    let mut cells: Vec<CellMark> = Vec::new();
    for layer in if named.is_empty() { &layers } else { &named } {
        let own = tiles(text, *layer, width, height)?;
        if offset(text, *layer)? != [0.0; 2] {
            let problem = "this layer has an offset, and its tiles are between the cells";
            let help = "set the offset of the layer, and of those that it is in, to 0";
            return Err(fault(text, *layer, problem, help));
        }
        cells.resize(own.len(), CellMark::Free);
        let walls = cells.iter_mut().zip(own).filter(|(_, tile)| *tile);
        walls.for_each(|(cell, _)| *cell = CellMark::Wall);
    }
    mark_objects(text, root, width, &mut cells)?;
    let mut rows = MarkRows::new(text);
    for row in cells.chunks(width) {
        row.iter().try_for_each(|cell| rows.push(*cell))?;
        rows.end_row(TextPosition::default())?;
    }
    rows.finish(source, WALLS)
}

fn size(text: &TextFile, root: Node, name: &str) -> MapResult<usize> {
    let value = root.attribute(name).unwrap_or_default();
    let problem = || format!("{name} {value:?} of the map is not a size");
    let size = value.parse().ok().filter(|size| *size > 0);
    size.ok_or_else(|| fault(text, root, problem(), HELP))
}

fn tiles(text: &TextFile, layer: Node, width: usize, height: usize) -> MapResult<Vec<bool>> {
    let data = layer.children().find(|node| node.has_tag_name("data"));
    let data = data.ok_or_else(|| fault(text, layer, "this layer has no data", HELP))?;
    let encoding = data.attribute("encoding").unwrap_or("XML");
    if encoding != "csv" || data.children().any(|node| node.is_element()) {
        let what = if encoding == "csv" { "chunks of an infinite map" } else { encoding };
        let problem = format!("the tiles of this layer are in {what}, not in CSV");
        return Err(fault(text, data, problem, HELP));
    }
    let numbers = data.text().unwrap_or_default();
    let from = data.first_child().map_or(0, |node| node.range().start);
    let tile = |number: &str| {
        let at = from + (number.as_ptr() as usize - numbers.as_ptr() as usize);
        let problem = || format!("{number:?} is not the number of a tile");
        let tile: Result<u32, _> = number.parse();
        tile.map(|tile| tile != 0).map_err(|_| text.error_at(text.place_of(at), problem(), HELP))
    };
    let numbers = numbers.split(',').map(str::trim).filter(|number| !number.is_empty());
    let tiles = numbers.map(tile).collect::<MapResult<Vec<bool>>>()?;
    if width.checked_mul(height) != Some(tiles.len()) {
        let problem = format!("this layer has {} tiles, not {width} x {height}", tiles.len());
        return Err(fault(text, data, problem, HELP));
    }
    Ok(tiles)
}

/// Returns what an object or a layer is called, in lower case, and then the layers that it is in:
/// names, types, and classes, as types are called in Tiled 1.9.
fn names<'a>(node: Node<'a, '_>) -> impl Iterator<Item = String> + 'a {
    let layers = node.ancestors().take_while(|node| !node.has_tag_name("map"));
    let names = layers.flat_map(|node| ["name", "type", "class"].map(|key| node.attribute(key)));
    names.flatten().map(str::to_lowercase)
}

/// Returns an attribute that is a number, 0 if there is none.
fn number(text: &TextFile, node: Node, name: &str) -> MapResult<f32> {
    let Some(value) = node.attribute(name) else { return Ok(0.0) };
    let wrong = || fault(text, node, format!("{name} {value:?} is not a number"), HELP);
    value.parse().ok().filter(|value: &f32| value.is_finite()).ok_or_else(wrong)
}

/// Whether a layer or an object is called a wall.
fn is_wall(node: Node) -> bool {
    let words = ["wall", "collision", "obstacle"];
    names(node).any(|name| words.iter().any(|word| name.contains(word)))
}

/// Returns by how many pixels a layer is moved, or what is in one.
fn offset(text: &TextFile, node: Node) -> MapResult<[f32; 2]> {
    node.ancestors().try_fold([0.0; 2], |[x, y], node| {
        Ok([x + number(text, node, "offsetx")?, y + number(text, node, "offsety")?])
    })
}

/// Returns the middle of an object, in pixels.
fn middle(text: &TextFile, object: Node) -> MapResult<[f32; 2]> {
    let number = |name| number(text, object, name);
    let (right, down) = (number("width")? / 2.0, number("height")? / 2.0);
    // A tile stands on its place, all else hangs from it; both turn around it.
    let down = if object.has_attribute("gid") { -down } else { down };
    let (sin, cos) = number("rotation")?.to_radians().sin_cos();
    let [x, y] = offset(text, object)?;
    let (x, y) = (x + number("x")?, y + number("y")?);
    Ok([x + right * cos - down * sin, y + right * sin + down * cos])
}

/// Marks the cells under objects called start and goal, or in layers of that name.
fn mark_objects(
    text: &TextFile,
    root: Node,
    width: usize,
    cells: &mut [CellMark],
) -> MapResult<()> {
    let mark = |name: String| match name.as_str() {
        "start" | "starts" | "s" => Some(CellMark::Start),
        "goal" | "goals" | "g" => Some(CellMark::Goal),
        _ => None,
    };
    let is_object = |node: &Node| {
        // Those of a tile are its shape.
        node.has_tag_name("object") && !node.ancestors().any(|node| node.has_tag_name("tileset"))
    };
    for object in root.descendants().filter(is_object) {
        let unfit = |problem: &str, help| fault(text, object, problem, help);
        if object.has_attribute("template") {
            let help = "Object > Detach Template Instance";
            return Err(unfit("this object is from a template", help));
        }
        let Some(mark) = names(object).find_map(mark) else {
            if is_wall(object) {
                let help = "draw walls as tiles of a layer called walls";
                return Err(unfit("this object is a wall, which only tiles can be", help));
            }
            continue;
        };
        if object.children().any(|node| ["polygon", "polyline"].contains(&node.tag_name().name())) {
            return Err(unfit("this object is a polygon", "starts and goals are points or tiles"));
        }
        let tile = [size(text, root, "tilewidth")? as f32, size(text, root, "tileheight")? as f32];
        let [x, y] = middle(text, object)?;
        let (x, y) = ((x / tile[0]).floor(), (y / tile[1]).floor());
        let inside = x >= 0.0 && x < width as f32 && y >= 0.0;
        let at = inside.then(|| (y as usize).saturating_mul(width).saturating_add(x as usize));
        match at.and_then(|at| cells.get_mut(at)) {
            None => return Err(unfit("this object is not on the map", WALLS)),
            Some(CellMark::Wall) => return Err(unfit("this object is in a wall", WALLS)),
            Some(cell) if *cell == CellMark::Free || *cell == mark => *cell = mark,
            Some(cell) => *cell = CellMark::Both,
        }
    }
    Ok(())
}

fn write(grid: &Grid) -> String {
    let (width, height) = (grid.width(), grid.height());
    let rows = rows_of(grid, |mark| if mark == CellMark::Wall { "1" } else { "0" }, ",");
    let mut objects = String::new();
    let named = grid.starts().iter().map(|cell| ("start", cell));
    for (name, cell) in named.chain(grid.goals().iter().map(|cell| ("goal", cell))) {
        let (x, y) = (cell.x * TILE + TILE / 2, cell.y * TILE + TILE / 2);
        let _ =
            writeln!(objects, "  <object name=\"{name}\" x=\"{x}\" y=\"{y}\"><point/></object>");
    }
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <map version=\"1.10\" orientation=\"orthogonal\" renderorder=\"right-down\" width=\"{width}\" \
         height=\"{height}\" tilewidth=\"{TILE}\" tileheight=\"{TILE}\" infinite=\"0\">\n \
         <layer id=\"1\" name=\"walls\" width=\"{width}\" height=\"{height}\">\n  \
         <data encoding=\"csv\">\n{}\n</data>\n </layer>\n \
         <objectgroup id=\"2\" name=\"marks\">\n{objects} </objectgroup>\n</map>\n",
        rows.join(",\n")
    )
}
