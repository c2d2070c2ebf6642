// Put into a page before anything else: when all is there, the body becomes JSON of what the page shows and of what
// went wrong.
const faults = [];
addEventListener("error", event => faults.push(event.message ?? `cannot load ${event.target.src.slice(0, 30)}`), true);
addEventListener("load", () => {
    const rows = table => [...document.querySelectorAll(`${table} tr`)];
    const texts = row => [...row.cells].map(cell => cell.innerText);
    // Whether the last pixel has been decoded.
    const whole = image => {
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
        const context = canvas.getContext("2d");
        context.drawImage(image, 0, 0);
        return context.getImageData(canvas.width - 1, canvas.height - 1, 1, 1).data[3] === 255;
    };
    const picture = image => {
        const size = [image.naturalWidth, image.naturalHeight];
        return { size, whole: size[0] > 0 && whole(image) };
    };
    const found = {
        categories: rows("#categories").map(texts),
        drawn: rows("#drawn").map(texts),
        pictures: [...document.images].map(picture),
        fetched: performance.getEntriesByType("resource").map(entry => entry.name),
        faults,
    };
    document.body.textContent = JSON.stringify(found);
});
