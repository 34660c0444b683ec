// The camera's image with cells and flow; points of the moment are in sixteenths of an image pixel.
function drawCamera(canvas, scale, flowColor, moment, image) {
  const pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  const step = scale / 16;
  for (const [color, points] of moment.cells) {
    pen.fillStyle = color;
    for (let i = 0; i < points.length; i += 2) {
      pen.fillRect(points[i] * step - 2, points[i + 1] * step - 2, 4, 4);
    }
  }
  pen.strokeStyle = flowColor;
  pen.lineWidth = 1.5;
  pen.beginPath();
  for (let i = 0; i < moment.flow.length; i += 4) {
    pen.moveTo(moment.flow[i] * step, moment.flow[i + 1] * step);
    pen.lineTo(moment.flow[i + 2] * step, moment.flow[i + 3] * step);
  }
  pen.stroke();
}
