//! What may be ordered of the viewer's workshop, and what it says where it cannot be had.

use selvedge_live::{MeshOrder, Order, Workshop};

use super::ViewWorkshop;
use crate::machine::Machine;

fn refused(change: impl FnOnce(&mut Order)) -> String {
    let mut workshop = ViewWorkshop::new("default", &[], Machine::Cpu).unwrap();
    let mut order = workshop.first_order();
    change(&mut order);
    match workshop.prepare(&order, &mut |_| ()) {
        Ok(_) => panic!("{order:?} was made"),
        Err(problem) => problem,
    }
}

fn mesh(name: &str, vertices: usize) -> Option<MeshOrder> {
    Some(MeshOrder {
        name: name.to_owned(),
        vertices,
    })
}

#[test]
fn a_page_cannot_open_what_was_not_named_at_the_start() {
    assert!(refused(|order| order.scene = "/etc/passwd".to_owned()).contains("no scene"));
    assert!(refused(|order| order.model = "../x.safetensors".to_owned()).contains("no model"));
    assert!(refused(|order| order.material = Some("x.toml".to_owned())).contains("no material"));
    assert!(refused(|order| order.mesh = mesh("x.obj", 289)).contains("no mesh"));
    assert!(refused(|order| order.mesh = mesh("square", 1_000_000)).contains("20 to 4096"));
}

#[test]
fn another_mesh_has_its_own_handles_and_is_said_to_be_beyond_training() {
    let mut workshop = ViewWorkshop::new("default", &[], Machine::Cpu).unwrap();
    let order = Order {
        mesh: mesh("triangle-17", 60),
        material: Some("11oz-black-denim".to_owned()),
        ..workshop.first_order()
    };
    let bench = workshop.prepare(&order, &mut |_| ()).unwrap();
    assert!(bench.cloth().handles.len() > 2);
    assert!(
        bench
            .remarks()
            .iter()
            .any(|remark| remark.contains("a guess"))
    );
    // The one that it was trained on is not.
    let first = workshop.first_order();
    let bench = workshop.prepare(&first, &mut |_| ()).unwrap();
    assert!(bench.remarks().is_empty(), "{:?}", bench.remarks());
    assert_eq!(bench.cloth().handles.len(), 2);
}
