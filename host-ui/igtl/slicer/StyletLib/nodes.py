"""Shows needle, seeds, gland and ultrasound as nodes of a MRML scene."""

import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

NEEDLE_MM = 200.0
RADIUS_MM = 0.635
"""Of a needle of 18 G."""
SEED_MM = 2.0
GLAND, STEEL, SEED = (0.85, 0.45, 0.4), (0.8, 0.85, 0.9), (1.0, 0.78, 0.0)


class Nodes:
    """Adds a node when the first content for it arrives, also after the scene was closed."""

    def __init__(self, scene):
        self.scene = scene
        self._shows = (
            ("Needle", self._needle),
            ("Gland", self._gland),
            ("Seeds", self._seeds),
            ("Ultrasound", self._ultrasound),
        )

    def show(self, newest):
        """Shows the newest content of each device, as `Link.poll` returns it."""
        for device, show in self._shows:
            if device in newest:
                show(newest[device])

    def _needle(self, matrix):
        moved, _ = self._node("vtkMRMLLinearTransformNode", "Stylet needle")
        whole = vtk.vtkMatrix4x4()
        whole.DeepCopy(matrix.ravel())
        moved.SetMatrixTransformToParent(whole)
        shape, is_new = self._node("vtkMRMLModelNode", "Stylet needle's shape")
        if is_new:
            shape.SetAndObservePolyData(rod())
            look(shape, STEEL, 1.0)
        shape.SetAndObserveTransformNodeID(moved.GetID())

    def _gland(self, surface):
        model, is_new = self._node("vtkMRMLModelNode", "Stylet gland")
        model.SetAndObservePolyData(smooth(*surface))
        if is_new:
            look(model, GLAND, 0.4)

    def _seeds(self, places_mm):
        markups, is_new = self._node("vtkMRMLMarkupsFiducialNode", "Stylet seeds")
        if is_new:
            markups.CreateDefaultDisplayNodes()
            markups.SetLocked(True)
            display = markups.GetDisplayNode()
            display.SetPointLabelsVisibility(False)
            display.SetPropertiesLabelVisibility(False)
            display.SetUseGlyphScale(False)
            display.SetGlyphSize(SEED_MM)
            display.SetSelectedColor(SEED)
        places = vtk.vtkPoints()
        for place_mm in places_mm:
            places.InsertNextPoint(place_mm)
        markups.SetControlPointPositionsWorld(places)

    def _ultrasound(self, picture):
        greys, ras_from_ijk = picture
        volume, is_new = self._node("vtkMRMLScalarVolumeNode", "Stylet ultrasound")
        image = vtk.vtkImageData()
        image.SetDimensions(greys.shape[1], greys.shape[0], 1)
        image.GetPointData().SetScalars(numpy_to_vtk(greys.ravel(), deep=True))
        whole = vtk.vtkMatrix4x4()
        whole.DeepCopy(ras_from_ijk.ravel())
        volume.SetIJKToRASMatrix(whole)
        volume.SetAndObserveImageData(image)
        if is_new:
            volume.CreateDefaultDisplayNodes()

    def _node(self, kind, name):
        """Returns the node of that name, and whether it is new."""
        node = self.scene.GetFirstNode(name, kind)
        return (node, False) if node else (self.scene.AddNewNodeByClass(kind, name), True)


def look(model, color, opacity):
    model.CreateDefaultDisplayNodes()
    display = model.GetDisplayNode()
    display.SetColor(color)
    display.SetOpacity(opacity)
    display.SetVisibility2D(True)


def rod():
    """Returns the needle's surface: its tip at the origin, its shaft along -z."""
    line = vtk.vtkLineSource()
    line.SetPoint2(0.0, 0.0, -NEEDLE_MM)
    line.SetPoint1(0.0, 0.0, 0.0)
    tube = vtk.vtkTubeFilter()
    tube.SetInputConnection(line.GetOutputPort())
    tube.SetRadius(RADIUS_MM)
    tube.SetNumberOfSides(12)
    tube.CappingOn()
    tube.Update()
    return tube.GetOutput()


def smooth(corners, triangles):
    places = vtk.vtkPoints()
    places.SetData(numpy_to_vtk(corners, deep=True))
    cells = vtk.vtkCellArray()
    cells.SetData(3, numpy_to_vtkIdTypeArray(triangles.ravel(), deep=True))
    flat = vtk.vtkPolyData()
    flat.SetPoints(places)
    flat.SetPolys(cells)
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputData(flat)
    normals.SplittingOff()
    normals.Update()
    return normals.GetOutput()
