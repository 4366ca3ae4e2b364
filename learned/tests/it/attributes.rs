//! People of a wanted height and weight, by the tube's two shapes: thick and long.

use xavatar_learned::attributes::{People, WantedPerson};

use super::tube::tube;

#[test]
fn people_are_as_tall_and_as_heavy_as_is_asked_for() {
    let body = tube();
    let people = People::of(&body);
    let mean = people.measured(&[0.0, 0.0]).unwrap();
    assert!((mean.measures.height - 1.0).abs() < 1e-6);
    let wanted = WantedPerson { height: Some(1.05), weight: Some(1.2 * mean.measures.weight) };
    let person = people.person(wanted, 0, 0).unwrap();
    assert!(
        (person.measures.height - 1.05).abs() <= 5e-4
            && (person.measures.weight - 1.2 * mean.measures.weight).abs() <= 0.05,
        "{person:?}"
    );
    let again = people.measured(&person.shape).unwrap();
    assert_eq!(again, person);

    // With a height alone there are many.
    let tall = WantedPerson { height: Some(1.05), weight: None };
    let [one, other] = [0, 1].map(|number| people.person(tall, 0, number).unwrap());
    assert!(
        (one.measures.height - other.measures.height).abs() <= 1e-3
            && (one.measures.weight - other.measures.weight).abs() > 0.1,
        "{one:?} {other:?}"
    );
    assert_eq!(people.person(tall, 0, 1).unwrap(), other);
    assert_ne!(people.person(tall, 7, 1).unwrap(), other);

    let giant = WantedPerson { height: Some(9.0), weight: None };
    let message = people.person(giant, 0, 0).unwrap_err().to_string();
    assert!(message.contains("nearest at 1.50 m"), "{message}");
}
