//! YAML and XML as one kind of tree, its leaves texts.

use saphyr_parser::{Event, Parser};

use crate::shell::fault::{Fault, FaultKind};

/// A value.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    /// A number or a word.
    Text(String),
    /// Several.
    List(Vec<Node>),
    /// By name.
    Map(Vec<(String, Node)>),
}

/// Deepest nesting: a camera has three.
const MAX_DEPTH: usize = 16;

impl Node {
    /// The YAML of ROS, or of OpenCV, whose first line and tags are no YAML.
    pub(super) fn of_yaml(text: &str) -> Result<Self, Fault> {
        let text = text.trim_start_matches('\u{feff}');
        // "%YAML:1.0", as OpenCV 3 and 4 write it.
        let text = match text.split_once('\n') {
            Some((first, rest)) if first.starts_with("%YAML:") => rest,
            _ => text,
        };
        let mut open: Vec<Open> = Vec::new();
        for event in Parser::new_from_str(text) {
            let (event, _) = event.map_err(|error| unreadable(format!("not YAML: {error}")))?;
            let whole = match event {
                Event::Scalar(text, ..) => Some(Self::Text(text.into_owned())),
                Event::SequenceStart(..) | Event::MappingStart(..) if open.len() >= MAX_DEPTH => {
                    return Err(unreadable(format!("YAML in more than {MAX_DEPTH} levels")));
                }
                Event::SequenceStart(..) => {
                    open.push(Open::List(Vec::new()));
                    None
                }
                Event::MappingStart(..) => {
                    open.push(Open::Map(Vec::new(), None));
                    None
                }
                Event::SequenceEnd | Event::MappingEnd => open.pop().map(Open::closed),
                Event::Alias(_) => return Err(unreadable("YAML with aliases, which no camera needs")),
                Event::Nothing
                | Event::StreamStart
                | Event::StreamEnd
                | Event::DocumentStart(_)
                | Event::DocumentEnd => None,
            };
            let Some(whole) = whole else { continue };
            match open.last_mut() {
                Some(parent) => parent.take(whole)?,
                // The first document is the camera.
                None => return Ok(whole),
            }
        }
        Err(unreadable("not YAML: nothing is in it"))
    }

    /// The XML of OpenCV.
    pub(super) fn of_xml(text: &str) -> Result<Self, Fault> {
        let document = roxmltree::Document::parse(text).map_err(|error| unreadable(format!("not XML: {error}")))?;
        let root = document.root_element();
        let name = root.tag_name().name();
        if name != "opencv_storage" {
            return Err(unreadable(format!("XML of <{name}>: that of OpenCV, <opencv_storage>, is read here")));
        }
        Self::of_element(root, 0)
    }

    fn of_element(element: roxmltree::Node<'_, '_>, depth: usize) -> Result<Self, Fault> {
        if depth >= MAX_DEPTH {
            return Err(unreadable(format!("XML in more than {MAX_DEPTH} levels")));
        }
        let mut children = element.children().filter(roxmltree::Node::is_element).peekable();
        if children.peek().is_none() {
            return Ok(Self::Text(element.text().unwrap_or_default().trim().trim_matches('"').to_owned()));
        }
        let fields =
            children.map(|child| Ok((child.tag_name().name().to_owned(), Self::of_element(child, depth + 1)?)));
        Ok(Self::Map(fields.collect::<Result<_, Fault>>()?))
    }

    /// The value of one of these names, without regard to case and underscores, with the name as it stands there.
    pub(super) fn get(&self, names: &[&str]) -> Option<(&str, &Self)> {
        let Self::Map(fields) = self else { return None };
        names.iter().find_map(|wanted| {
            let field = fields.iter().find(|(name, _)| name.replace('_', "").eq_ignore_ascii_case(wanted));
            field.map(|(name, value)| (name.as_str(), value))
        })
    }

    /// All numbers below it, in their order; the word that is none otherwise.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, String> {
        let mut numbers = Vec::new();
        self.add_numbers(&mut numbers)?;
        Ok(numbers)
    }

    fn add_numbers(&self, numbers: &mut Vec<f64>) -> Result<(), String> {
        match self {
            Self::Text(text) => text.split_whitespace().try_for_each(|word| {
                numbers.push(word.parse().map_err(|_| word.to_owned())?);
                Ok(())
            }),
            Self::List(all) => all.iter().try_for_each(|one| one.add_numbers(numbers)),
            Self::Map(_) => Err("a map".into()),
        }
    }
}

/// What has begun and not ended.
enum Open {
    List(Vec<Node>),
    /// With the name whose value is awaited.
    Map(Vec<(String, Node)>, Option<String>),
}

impl Open {
    fn take(&mut self, node: Node) -> Result<(), Fault> {
        match self {
            Self::List(all) => all.push(node),
            Self::Map(fields, name) => match (name.take(), node) {
                (Some(name), node) => fields.push((name, node)),
                (None, Node::Text(text)) => *name = Some(text),
                (None, _) => return Err(unreadable("YAML with names that are no texts")),
            },
        }
        Ok(())
    }

    fn closed(self) -> Node {
        match self {
            Self::List(all) => Node::List(all),
            Self::Map(fields, _) => Node::Map(fields),
        }
    }
}

fn unreadable(detail: impl Into<String>) -> Fault {
    Fault::new(FaultKind::Unreadable, detail)
}
