/** Small ways with the document; text is only ever put in as text. */

export const byId = (id) => document.getElementById(id);

/** Return a new element with text or children. */
export function make(name, className = "", ...inside) {
  const element = document.createElement(name);
  if (className) element.className = className;
  element.append(...inside);
  return element;
}

/** Put text where it is not yet: assistive technology reads changes only. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Fill a table body with rows of cells; a cell is text, or [text, className]. */
export function fillRows(body, rows) {
  body.replaceChildren(
    ...rows.map((cells) =>
      make("tr", "", ...cells.map((cell, column) => {
        const [text, className] = Array.isArray(cell) ? cell : [cell, ""];
        const element = make(column ? "td" : "th", className, text);
        if (!column) element.scope = "row";
        return element;
      })),
    ),
  );
}
